// Writes streams and models compressed by meshoptimizer's own encoders (npm meshoptimizer and gltfpack), and
// what its own decoder reads from them: meshopt.json, which has values where they are filtered and their hash
// where they are exact, and a plain twin of each wave.
//
//     npm install meshoptimizer@1.3.0 gltfpack@1.3.0
//     node meshopt.mjs node_modules

import { createHash } from "node:crypto";
import { writeFileSync } from "node:fs";
import { pathToFileURL } from "node:url";
import { crc32, deflateSync } from "node:zlib";

const load = (path) => import(pathToFileURL(`${process.argv[2]}/${path}`));
const { MeshoptEncoder: encoder, MeshoptDecoder: decoder } = await load("meshoptimizer/index.js");
const { pack } = await load("gltfpack/library.js");
await Promise.all([encoder.ready, decoder.ready]);
const here = (name) => new URL(name, import.meta.url);
const base64 = (bytes) => Buffer.from(bytes.buffer, bytes.byteOffset, bytes.byteLength).toString("base64");

// Numbers without a pattern (a linear congruential generator's high bits).
let state = 1;
const random = (n) => ((state = (Math.imul(state, 1664525) + 1013904223) >>> 0) >>> 8) % n;

const cases = [];

function keep(name, stream, layout) {
    const { mode, filter = "NONE", count, byteStride } = layout;
    const values = new Uint8Array(count * byteStride);
    decoder.decodeGltfBuffer(values, count, byteStride, stream, mode, filter);
    const sha256 = createHash("sha256").update(values).digest("hex");
    const expected = layout.filter ? { values: base64(values) } : { sha256 };
    cases.push({ name, layout, stream: base64(stream), ...expected });
}

// Attributes: elements whose channels want each kind of delta, and whose bytes each width of code.
function elements(count, stride) {
    const view = new DataView(new ArrayBuffer(count * stride));
    for (let i = 0; i < count; i++) {
        for (let at = 0; at < stride; at += 4) {
            const [kind, put] = [(at / 4) % 7, i * stride + at];
            if (kind === 0) view.setFloat32(put, 3 + Math.sin(i / 9 + at), true);
            if (kind === 1) [0, 2].forEach((k) => view.setUint16(put + k, 260 * i + 7 * k + random(9), true));
            if (kind === 2) [0, 1, 2, 3].forEach((k) => view.setUint8(put + k, random(256)));
            if (kind === 3) view.setUint32(put, i % 11 ? 0 : 5, true);
            if (kind === 4) [0, 1, 2, 3].forEach((k) => view.setUint8(put + k, i / 4 + random(1 << k)));
            if (kind === 5) view.setUint32(put, 0x12345678, true);
            if (kind === 6) view.setUint32(put, (0x3f800000 + i * 0x1357) << 3, true);
        }
    }
    return new Uint8Array(view.buffer);
}

const seen = { controls: new Set(), channels: new Set() };
for (const [count, stride] of [[1, 4], [15, 12], [16, 28], [17, 28], [70, 28], [300, 4], [35, 256]]) {
    const source = elements(count, stride);
    for (const [version, level] of [[0, 2], [1, 2], [1, 3]]) {
        if (level === 3 && count !== 70) continue;
        if (version === 0 && stride === 256) continue;
        const stream = encoder.encodeVertexBufferLevel(source, count, stride, level, version);
        const layout = { mode: "ATTRIBUTES", count, byteStride: stride };
        keep(`attributes of ${stride} × ${count}, version ${version}, level ${level}`, stream, layout);
        if (version === 0) continue;
        const control = [...stream.slice(1, 1 + stride / 4)];
        control.flatMap((c) => [c, c >> 2, c >> 4, c >> 6]).forEach((c) => seen.controls.add(c & 3));
        stream.slice(-stride / 4).forEach((c) => seen.channels.add(c));
    }
}
for (const mode of [0, 1, 2, 3]) {
    const channel = mode === 3 || [...seen.channels].some((c) => (c & 15) === mode);
    if (!channel || !seen.controls.has(mode)) throw new Error(`none of mode ${mode}: ${[...seen.channels]}`);
}
if (![...seen.channels].some((c) => c > 15)) throw new Error("no rotation");

// Triangles: a grid, one out of order, one twice (which starts anew), and far indices.
function grid(n) {
    const quads = Array.from({ length: n * n }, (_, i) => (n + 1) * Math.floor(i / n) + (i % n));
    return quads.flatMap((q) => [q, q + 1, q + n + 1, q + n + 1, q + 1, q + n + 2]);
}
const reordered = (indices) => {
    const array = Uint32Array.from(indices);
    encoder.reorderMesh(array, true, true);
    return [...array];
};
const far = Array.from({ length: 60 }, () => random(1 << 24) * 250);
for (const [name, indices] of [
    ["a grid", grid(6)],
    ["a reordered grid", reordered(grid(6))],
    ["two grids", [...grid(3), ...grid(3)]],
    ["far vertices", far],
    ["few vertices", Array.from({ length: 90 }, () => random(23))],
]) {
    for (const byteStride of name === "far vertices" ? [4] : [2, 4]) {
        const source = new Uint8Array((byteStride === 2 ? Uint16Array : Uint32Array).from(indices).buffer);
        const layout = (mode) => ({ mode, count: indices.length, byteStride });
        const triangles = encoder.encodeIndexBuffer(source, indices.length, byteStride);
        keep(`triangles of ${name}, ${byteStride} bytes`, triangles, layout("TRIANGLES"));
        const sequence = encoder.encodeIndexSequence(source, indices.length, byteStride);
        keep(`indices of ${name}, ${byteStride} bytes`, sequence, layout("INDICES"));
    }
}

// Filters: unit vectors all around, quaternions, floats of many sizes, colours.
const count = 40;
const vectors = Array.from({ length: count }, (_, i) => {
    const [z, turn] = [1 - (2 * i) / (count - 1), 2.4 * i];
    const r = Math.sqrt(1 - z * z);
    return [r * Math.cos(turn), r * Math.sin(turn), z, i % 2 ? 1 : -1];
});
const quaternions = vectors.map(([x, y, z], i) => {
    const v = [x * Math.sin(i), y * Math.sin(i), z * Math.sin(i), Math.cos(i)];
    return [0, 1, 2, 3].map((k) => v[(k + i) % 4]);
});
const floats = vectors.map(([x, y, z], i) => [x * 10 ** (i / 2 - 10), 100 * y, z ** 9]);
const colours = vectors.map(([x, y, z], i) => [Math.abs(x), Math.abs(y), Math.abs(z), i / count]);
for (const [filter, stride, bits, source, encode, ...options] of [
    ["OCTAHEDRAL", 4, 8, vectors, encoder.encodeFilterOct],
    ["OCTAHEDRAL", 4, 5, vectors, encoder.encodeFilterOct],
    ["OCTAHEDRAL", 8, 16, vectors, encoder.encodeFilterOct],
    ["OCTAHEDRAL", 8, 10, vectors, encoder.encodeFilterOct],
    ["QUATERNION", 8, 16, quaternions, encoder.encodeFilterQuat],
    ["QUATERNION", 8, 9, quaternions, encoder.encodeFilterQuat],
    ["EXPONENTIAL", 12, 24, floats, encoder.encodeFilterExp, "Separate"],
    ["EXPONENTIAL", 12, 11, floats, encoder.encodeFilterExp, "SharedVector"],
    ["COLOR", 4, 8, colours, encoder.encodeFilterColor],
    ["COLOR", 4, 6, colours, encoder.encodeFilterColor],
    ["COLOR", 8, 16, colours, encoder.encodeFilterColor],
    ["COLOR", 8, 11, colours, encoder.encodeFilterColor],
]) {
    const filtered = encode(Float32Array.from(source.flat()), count, stride, bits, ...options);
    const stream = encoder.encodeVertexBufferLevel(filtered, count, stride, 2, filter === "COLOR" ? 1 : 0);
    const layout = { mode: "ATTRIBUTES", filter, count, byteStride: stride };
    keep(`${filter} of ${stride} bytes, ${bits} bits`, stream, layout);
}
writeFileSync(here("meshopt.json"), `[\n${cases.map((c) => JSON.stringify(c)).join(",\n")}\n]\n`);

// Models: a flat square and a wavy one, textured, as binary glTF for gltfpack.
function png(pixels) {
    const chunk = (type, data) => {
        const body = Buffer.concat([Buffer.from(type), data]);
        const number = (n) => Buffer.from([n >>> 24, n >>> 16, n >>> 8, n]);
        return Buffer.concat([number(data.length), body, number(crc32(body))]);
    };
    const rows = Buffer.from([0, ...pixels[0], ...pixels[1], 0, ...pixels[2], ...pixels[3]]);
    const header = Buffer.from([0, 0, 0, 2, 0, 0, 0, 2, 8, 2, 0, 0, 0]);
    const signature = Buffer.from([0x89, 0x50, 0x4e, 0x47, 13, 10, 26, 10]);
    return Buffer.concat([
        signature, chunk("IHDR", header), chunk("IDAT", deflateSync(rows)), chunk("IEND", Buffer.alloc(0)),
    ]);
}

function glb(json, binary) {
    const padded = (bytes, by) => Buffer.concat([bytes, Buffer.alloc(-bytes.length & 3, by)]);
    const [text, data] = [padded(Buffer.from(JSON.stringify(json)), 32), padded(binary, 0)];
    const words = (...numbers) => Buffer.from(Uint32Array.from(numbers).buffer);
    return Buffer.concat([
        words(0x46546c67, 2, 28 + text.length + data.length), words(text.length, 0x4e4f534a), text,
        words(data.length, 0x004e4942), data,
    ]);
}

function square(n, height) {
    const place = (_, i) => [(i % (n + 1)) / n, Math.floor(i / (n + 1)) / n];
    const places = Array.from({ length: (n + 1) ** 2 }, place);
    const slopes = ([u, v]) => [height * Math.cos(5 * u), -height * Math.sin(4 * v)];
    const normals = places.map((p) => {
        const [x, y] = slopes(p);
        const length = Math.hypot(x, y, 1);
        return [-x / length, -y / length, 1 / length];
    });
    const over = ([u, v]) => height * (Math.sin(5 * u) / 2.5 + Math.cos(4 * v) / 2);
    const positions = places.map(([u, v]) => [2 * u - 1, 2 * v - 1, over([u, v])]);
    const pictures = [
        png([[255, 0, 0], [0, 255, 0], [0, 0, 255], [255, 255, 0]]),
        png([[128, 128, 255], [218, 128, 218], [128, 218, 218], [128, 128, 255]]),
    ];
    const [bytes, bufferViews, accessors] = [[], [], []];
    const view = (data) => {
        const byteOffset = bytes.reduce((sum, b) => sum + b.length, 0);
        bytes.push(data, Buffer.alloc(-data.length & 3));
        return bufferViews.push({ buffer: 0, byteOffset, byteLength: data.length }) - 1;
    };
    const accessor = (vectors, type) => {
        const array = (type === "SCALAR" ? Uint32Array : Float32Array).from(vectors.flat());
        const bounds = type === "VEC3" && vectors === positions && {
            min: [0, 1, 2].map((k) => Math.fround(Math.min(...positions.map((p) => p[k])))),
            max: [0, 1, 2].map((k) => Math.fround(Math.max(...positions.map((p) => p[k])))),
        };
        const bufferView = view(Buffer.from(array.buffer));
        const componentType = type === "SCALAR" ? 5125 : 5126;
        return accessors.push({ bufferView, componentType, count: vectors.length, type, ...bounds }) - 1;
    };
    const attributes = {
        POSITION: accessor(positions, "VEC3"),
        NORMAL: accessor(normals, "VEC3"),
        TEXCOORD_0: accessor(places.map(([u, v]) => [u, 1 - v]), "VEC2"),
    };
    const indices = accessor(grid(n), "SCALAR");
    const images = pictures.map((p) => ({ mimeType: "image/png", bufferView: view(p) }));
    const binary = Buffer.concat(bytes);
    return glb({
        asset: { version: "2.0" }, scene: 0, scenes: [{ nodes: [0] }], nodes: [{ mesh: 0 }],
        meshes: [{ primitives: [{ attributes, indices, material: 0 }] }],
        materials: [{
            pbrMetallicRoughness: { baseColorTexture: { index: 0 }, metallicFactor: 0 },
            normalTexture: { index: 1 },
        }],
        textures: [{ source: 0 }, { source: 1 }],
        images, accessors, bufferViews, buffers: [{ byteLength: binary.length }],
    }, binary);
}

const names = ["EXT_meshopt_compression", "KHR_meshopt_compression"];

// The same model with its compressed views decoded, one buffer for each view.
function plain(json, buffers) {
    json = structuredClone(json);
    const outside = json.bufferViews.map((view) => {
        const packed = names.map((name) => view.extensions?.[name]).find((e) => e);
        const from = packed ?? view;
        const at = from.byteOffset ?? 0;
        let bytes = buffers[from.buffer].subarray(at, at + from.byteLength);
        if (packed) {
            const values = new Uint8Array(packed.count * packed.byteStride);
            const { count, byteStride, mode, filter } = packed;
            decoder.decodeGltfBuffer(values, count, byteStride, bytes, mode, filter);
            bytes = values;
        }
        delete view.extensions;
        return bytes;
    });
    json.bufferViews.forEach((view, i) => Object.assign(view, { buffer: i, byteOffset: 0 }));
    json.buffers = outside.map((bytes) => ({
        byteLength: bytes.length, uri: `data:application/octet-stream;base64,${base64(bytes)}`,
    }));
    for (const list of ["extensionsUsed", "extensionsRequired"]) {
        json[list] = json[list].filter((name) => !names.includes(name));
    }
    return json;
}

async function packed(name, model, options) {
    const written = {};
    const read = (path) => {
        if (path !== "in.glb") throw new Error(`no ${path}`);
        return model;
    };
    const write = (path, data) => (written[path] = Buffer.from(data));
    const out = name.endsWith("glb") ? "out.glb" : "out.gltf";
    await pack(["-i", "in.glb", "-o", out, ...options], { read, write });
    let json;
    let buffers;
    if (out === "out.glb") {
        const file = written[out];
        const length = file.readUInt32LE(12);
        json = JSON.parse(file.subarray(20, 20 + length));
        buffers = [file.subarray(28 + length)];
        writeFileSync(here(name), file);
    } else {
        json = JSON.parse(written[out]);
        buffers = json.buffers.map(({ uri }) => written[uri]);
        // The buffer for readers without the extension stays a file, which is not there.
        json.buffers[0].uri = `data:application/octet-stream;base64,${base64(buffers[0])}`;
        writeFileSync(here(name), JSON.stringify(json));
    }
    if (!json.extensionsUsed.some((used) => names.includes(used))) throw new Error(`${name} is plain`);
    return JSON.stringify(plain(json, buffers));
}

await packed("b47_meshopt.gltf", square(4, 0), ["-c", "-cf"]);
for (const [name, options] of [
    ["b48_meshopt_cc", ["-cc", "-vpf", "-vn", "10"]],
    ["b49_meshopt_khr", ["-cz", "-vp", "16"]],
]) {
    writeFileSync(here(`${name}_plain.gltf`), await packed(`${name}.glb`, square(9, 0.3), options));
}
