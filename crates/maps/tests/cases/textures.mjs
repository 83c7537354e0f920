// Writes KTX2 files by ktx-parse, and Basis Universal by its own encoder (npm ktx2-encoder has it), decoded by its
// own transcoder. Called by textures.py: node textures.mjs node_modules, tasks on standard input.

import { readFileSync } from "node:fs";
import { pathToFileURL } from "node:url";

const load = (path) => import(pathToFileURL(`${process.argv[2]}/${path}`));
const { createDefaultContainer, write } = await load("ktx-parse/dist/index.mjs");
const { default: loadBasis } = await load("ktx2-encoder/dist/basis/basis_encoder.js");
const tasks = JSON.parse(readFileSync(0, "utf8"));
const bytes = (hex) => new Uint8Array(Buffer.from(hex, "hex"));
const hex = (array) => Buffer.from(array).toString("hex");
const made = {};

for (const [name, task] of Object.entries(tasks.plain)) {
    const file = createDefaultContainer();
    file.vkFormat = task.format;
    file.typeSize = 1;
    [file.pixelWidth, file.pixelHeight] = [tasks.width, tasks.height];
    file.levelCount = 1;
    file.supercompressionScheme = task.zstd ? 2 : 0;
    const level = bytes(task.level);
    file.levels = [{ levelData: level, uncompressedByteLength: task.length }];
    const descriptor = file.dataFormatDescriptor[0];
    descriptor.colorModel = task.model ?? 1;
    descriptor.transferFunction = 1;
    descriptor.texelBlockDimension = task.model ? [3, 3, 0, 0] : [0, 0, 0, 0];
    const channel = (i) => ({
        channelType: [0, 1, 2, 15][i], bitOffset: 8 * i, bitLength: 7, samplePosition: [0, 0, 0, 0],
        sampleLower: 0, sampleUpper: 255,
    });
    descriptor.bytesPlane = [task.model ? 16 : task.channels, 0, 0, 0, 0, 0, 0, 0];
    descriptor.samples = task.model
        ? [{ ...channel(0), bitLength: 127, sampleUpper: 0xffffffff }]
        : Array.from({ length: task.channels }, (_, i) => channel(i));
    file.keyValue = { KTXwriter: "ktx-parse", ...task.keys };
    made[name] = { file: hex(write(file, { keepWriter: true })) };
}

const basis = await loadBasis();
basis.initializeBasis();
const RGBA32 = basis.transcoder_texture_format.cTFRGBA32.value;

function encoded(options, { width, height, rgba } = tasks) {
    const encoder = new basis.BasisEncoder();
    encoder.setCreateKTX2File(options.ktx2);
    encoder.setUASTC(options.uastc ?? false);
    encoder.setKTX2UASTCSupercompression(options.zstd ?? false);
    encoder.setKTX2AndBasisSRGBTransferFunc(false);
    encoder.setPerceptual(false);
    encoder.setQualityLevel(200);
    encoder.setMipGen(options.mips ?? false);
    encoder.setYFlip(options.flip ?? false);
    if (options.swizzle) encoder.setSwizzle(...options.swizzle);
    if (options.opaque) encoder.setCheckForAlpha(false);
    encoder.setSliceSourceImage(0, bytes(rgba), width, height, 0);
    const out = new Uint8Array(1 << 20);
    const length = encoder.encode(out);
    encoder.delete();
    if (!length) throw new Error("the encoder failed");
    return out.slice(0, length);
}

function decoded(data, ktx2) {
    const file = ktx2 ? new basis.KTX2File(data) : new basis.BasisFile(data);
    if (!file.startTranscoding()) throw new Error("the transcoder failed");
    const out = new Uint8Array(4 * tasks.width * tasks.height);
    const done = ktx2
        ? file.transcodeImage(out, 0, 0, 0, RGBA32, 0, -1, -1)
        : file.transcodeImage(out, 0, 0, RGBA32, 0, 0);
    if (!done) throw new Error("the transcoder failed");
    file.close();
    file.delete();
    return out;
}

const all = [0, 1, 2, 3];
for (const [name, options, channels] of [
    ["etc1s.ktx2", { opaque: true, mips: true }, [0, 1, 2]],
    ["etc1s_alpha.ktx2", {}, all],
    ["uastc.ktx2", { uastc: true }, all],
    ["uastc_zstd.ktx2", { uastc: true, zstd: true, opaque: true }, [0, 1, 2]],
    ["etc1s.basis", { opaque: true }, [0, 1, 2]],
    ["uastc.basis", { uastc: true, mips: true }, all],
    ["uastc_below.basis", { uastc: true, flip: true }, all],
]) {
    const ktx2 = name.endsWith("ktx2");
    const data = encoded({ ktx2, ...options });
    let values = decoded(data, ktx2);
    if (options.flip) {
        const row = 4 * tasks.width;
        const rows = Array.from({ length: tasks.height }, (_, y) => values.slice(y * row, (y + 1) * row));
        values = Buffer.concat(rows.reverse());
    }
    made[name] = { file: hex(data), values: hex(values), channels };
}
made["map.basis"] = { file: hex(encoded({ ktx2: false, uastc: true }, tasks.common)) };
console.log(JSON.stringify(made));
