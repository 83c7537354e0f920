"""Writes the textures beside this script, and the values that other decoders read from them (textures.json).

Needs numpy, Pillow, etcpak, texture2ddecoder and imagecodecs (versions below), and for KTX2 and Basis Universal
the npm packages ktx-parse and ktx2-encoder (Basis Universal's own encoder and transcoder):

    pip install numpy==2.4.6 pillow==13.0.0 etcpak==0.9.15 texture2ddecoder==1.0.6 imagecodecs==2026.3.6
    npm install ktx-parse@2.0.0 ktx2-encoder@0.6.0
    python textures.py node_modules

Values are lists of texels from the top left; `largest` is the value that stands for 1.
"""

import io
import json
import struct
import subprocess
import sys
from pathlib import Path

import etcpak
import imagecodecs
import numpy as np
import texture2ddecoder
from PIL import Image

HERE = Path(__file__).parent
WIDTH, HEIGHT = 6, 5
expected = {}
random = np.random.default_rng(7)

# The normal map that all textures are of: 8-bit codes, and an alpha that is nowhere the same.
y, x = np.mgrid[0:HEIGHT, 0:WIDTH]
normals = np.stack([0.5 * np.sin(0.8 * x + 0.3), 0.4 * np.cos(0.9 * y), np.ones_like(x, float)], -1)
normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
rgb = np.round((normals + 1) * 127.5).astype(np.uint8)
alpha = (40 + 7 * x + 31 * y).astype(np.uint8)
rgba = np.dstack([rgb, alpha])
padded = np.pad(rgba, ((0, 3), (0, 2), (0, 0)), mode="edge")


def keep(name, data, values, largest):
    """Writes a file, and what is to be read from it."""
    if data is not None:
        (HERE / name).write_bytes(data)
    values = np.asarray(values)[:HEIGHT, :WIDTH]
    values = values.reshape(HEIGHT * WIDTH, -1)
    numbers = [v if isinstance(v, int) else round(float(v), 9) for v in values.flatten().tolist()]
    expected[name] = {"channels": values.shape[1], "largest": largest, "values": numbers}


def dds(data, *, dxgi=None, four_cc=0, flags=0, bits=0, masks=(0, 0, 0, 0)):
    """A DDS file ("Programming Guide for DDS", Microsoft): header, DXGI's header, level."""
    if dxgi is not None:
        four_cc = b"DX10"
    if isinstance(four_cc, bytes):
        four_cc = struct.unpack("<I", four_cc)[0]
    pixels = struct.pack("<8I", 32, flags or 4, four_cc, bits, *masks)
    header = struct.pack("<7I44x", 124, 0x1007, HEIGHT, WIDTH, 0, 0, 0) + pixels
    header += struct.pack("<5I", 0x1000, 0, 0, 0, 0)
    long = b"" if dxgi is None else struct.pack("<5I", dxgi, 3, 0, 1, 0)
    return b"DDS " + header + long + data


def by_pillow(data, mode):
    return np.asarray(Image.open(io.BytesIO(data)).convert(mode))


def saved(picture, **options):
    out = io.BytesIO()
    picture.save(out, "DDS", **options)
    return out.getvalue()


def agree(values, other, what):
    """Two decoders differ by the rounding of ramps at most."""
    most = np.abs(np.asarray(values, int) - np.asarray(other, int)).max()
    assert most <= 1, f"{what}: decoders differ by {most}"


# Block compression, encoded and decoded by Pillow; a second decoder must agree.
def second(name, blocks):
    decode = getattr(texture2ddecoder, f"decode_{name}")
    bgra = np.frombuffer(decode(blocks, 8, 8), np.uint8).reshape(8, 8, 4)
    return bgra[:HEIGHT, :WIDTH, [2, 1, 0, 3]]


opaque = Image.fromarray(rgb)
data = saved(opaque, pixel_format="DXT1")
values = by_pillow(data, "RGB")
agree(values, second("bc1", data[128:])[..., :3], "BC1")
keep("bc1.dds", data, values, 255)

clear = Image.fromarray(np.dstack([rgb, np.where(x > 3, 0, 255).astype(np.uint8)]))
data = saved(clear, pixel_format="DXT1")
values = by_pillow(data, "RGBA")
assert set(values[..., 3].flatten()) == {0, 255}
keep("bc1_clear.dds", data, values, 255)

data = saved(Image.fromarray(rgba), pixel_format="DXT3")
keep("bc2.dds", data, by_pillow(data, "RGBA"), 255)

data = saved(Image.fromarray(rgba), pixel_format="DXT5")
values = by_pillow(data, "RGBA")
agree(values, second("bc3", data[128:]), "BC3")
keep("bc3.dds", data, values, 255)

# DXT5nm: x in alpha, y in green, red full.
full = np.full_like(alpha, 255)
data = saved(Image.fromarray(np.dstack([full, rgb[..., 1], full, rgb[..., 0]])), pixel_format="DXT5")
keep("bc3_dxt5nm.dds", data, by_pillow(data, "RGBA"), 255)

blocks = etcpak.compress_bc7(padded.tobytes(), 8, 8)
data = dds(blocks, dxgi=98)
values = by_pillow(data, "RGBA")
agree(values, second("bc7", blocks), "BC7")
assert np.abs(values.astype(int) - rgba).max() < 32, "BC7 is of the picture"
keep("bc7.dds", data, values, 255)
bc7 = blocks

# Blocks of any bits, of each of BC7's modes: as many zeros as the mode's number, then a one.
for first in 0, 4:
    noise = random.integers(0, 256, (4, 16), dtype=np.uint8)
    for i in range(4):
        mode = first + i
        noise[i, 0] = int(noise[i, 0]) >> (mode + 1) << (mode + 1) | 1 << mode
    data = dds(noise.tobytes(), dxgi=98)
    values = by_pillow(data, "RGBA")
    agree(values, second("bc7", noise.tobytes()), "BC7 of any bits")
    keep(f"bc7_modes{first}.dds", data, values, 255)


# Ramps in closed form (Khronos Data Format Specification 1.3, section 19): eight values, or six and the ends.
def ramp_block(values, ends, signed):
    """Block of the two ends, and the values that it stands for, in units of the ends."""
    a, b = ends
    low, high = (-127, 127) if signed else (0, 255)
    if a > b:
        steps = [a, b] + [((7 - i) * a + i * b) / 7 for i in range(1, 7)]
    else:
        steps = [a, b] + [((5 - i) * a + i * b) / 5 for i in range(1, 5)] + [low, high]
    steps = np.array(steps)
    nearest = np.abs(values.reshape(16, 1) - steps).argmin(1)
    bits = sum(int(k) << (3 * i) for i, k in enumerate(nearest))
    return bytes([a & 255, b & 255]) + bits.to_bytes(6, "little"), steps[nearest].reshape(4, 4)


def ramps(channel, signed):
    """Blocks of 8 x 8 texels of one channel, and their values."""
    data, out = {}, np.zeros((8, 8))
    for by in 0, 4:
        for bx in 0, 4:
            part = channel[by : by + 4, bx : bx + 4]
            ends = round(float(part.max())), round(float(part.min()))
            # The last block runs up: six values and both ends of the range.
            ends = ends[::-1] if by and bx else ends
            data[by, bx], out[by : by + 4, bx : bx + 4] = ramp_block(part, ends, signed)
    return data, out


def joined(*channels):
    return b"".join(channel[place] for place in sorted(channels[0]) for channel in channels)


floats = np.pad(normals, ((0, 3), (0, 2), (0, 0)), mode="edge")
(ux, vx), (uy, vy) = (ramps((floats[..., c] + 1) * 127.5, False) for c in (0, 1))
data = dds(joined(ux), four_cc=b"ATI1")
agree(np.round(vx[:HEIGHT, :WIDTH]), second("bc4", joined(ux))[..., 0], "BC4")
keep("bc4.dds", data, vx / 255, 1)
data = dds(joined(ux, uy), four_cc=b"ATI2")
both = np.dstack([vx, vy])
agree(np.round(both[:HEIGHT, :WIDTH]), second("bc5", joined(ux, uy))[..., :2], "BC5")
agree(np.round(both[:HEIGHT, :WIDTH]), by_pillow(data, "RGB")[..., :2], "BC5")
keep("bc5.dds", data, both / 255, 1)
(sx, vx), (sy, vy) = (ramps(floats[..., c] * 127, True) for c in (0, 1))
both = np.dstack([vx, vy]) / 127
keep("bc4_signed.dds", dds(joined(sx), dxgi=81), both[..., :1], 1)
data = dds(joined(sx, sy), dxgi=84)
# Pillow shows signed values from 0 to 255.
agree(np.round((both[:HEIGHT, :WIDTH] + 1) * 127.5), by_pillow(data, "RGB")[..., :2], "BC5_SNORM")
keep("bc5_signed.dds", data, both, 1)


# BC6H in mode 11 (Microsoft, "BC6H Format"): two ends of 10 bits, 16 weights of 4 bits, the first of 3.
def hdr_block(low, high, weights, signed):
    scale = [0, 4, 9, 13, 17, 21, 26, 30, 34, 38, 43, 47, 51, 55, 60, 64]
    bits, place = 0b00011, 5
    for code in [*low, *high]:
        bits |= (code & 1023) << place
        place += 10
    for i, weight in enumerate(weights):
        bits |= int(weight) << place
        place += 3 if i == 0 else 4
    assert place == 128

    def widened(code):
        if signed:
            size = abs(code)
            wide = 0 if size == 0 else 0x7FFF if size >= 511 else ((size << 15) + 0x4000) >> 9
            return wide if code >= 0 else -wide
        return 0 if code == 0 else 0xFFFF if code == 1023 else ((code << 16) + 0x8000) >> 10

    out = np.zeros((16, 3))
    for i, weight in enumerate(weights):
        for c in range(3):
            a, b = widened(low[c]), widened(high[c])
            value = (a * (64 - scale[weight]) + b * scale[weight] + 32) >> 6
            half = (abs(value) * 31) >> 5 if signed else (value * 31) >> 6
            out[i, c] = np.uint16(half).view(np.float16) * (-1 if value < 0 else 1)
    return bits.to_bytes(16, "little"), out.reshape(4, 4, 3)


for name, dxgi, signed in ("bc6h.dds", 95, False), ("bc6h_signed.dds", 96, True):
    parts, out = [], np.zeros((8, 8, 3))
    for i, (by, bx) in enumerate([(0, 0), (0, 4), (4, 0), (4, 4)]):
        low = [-300 + 90 * i, 20, -511] if signed else [100 + 150 * i, 0, 333]
        high = [290, -480 + 200 * i, 511] if signed else [700, 1023 - 200 * i, 480]
        weights = np.append(random.integers(0, 8), random.integers(0, 16, 15))
        block, out[by : by + 4, bx : bx + 4] = hdr_block(low, high, weights, signed)
        parts.append(block)
    halves = imagecodecs.bcn_decode(b"".join(parts), 6 if not signed else -6, shape=(8, 8, 3))
    assert np.array_equal(halves.astype(float), out), f"{name}: decoders differ"
    keep(name, dds(b"".join(parts), dxgi=dxgi), out, 1)

# Plain layouts.
RGBA_MASKS = (0xFF, 0xFF00, 0xFF0000, 0xFF000000)
keep("rgba8.dds", dds(rgba.tobytes(), flags=0x41, bits=32, masks=RGBA_MASKS), rgba, 255)
data = saved(Image.fromarray(rgba))
assert np.array_equal(by_pillow(data, "RGBA"), rgba)
keep("bgra8.dds", data, rgba, 255)
data = saved(opaque)
keep("bgr8.dds", data, rgb, 255)
data = saved(Image.fromarray(rgb[..., 0]))
keep("l8.dds", data, rgb[..., 0], 255)
# 5, 6 and 5 bits of each channel, over 255 to the nearest.
fives = np.round(rgb / 255 * [31, 63, 31]).astype(np.uint16)
packed = fives[..., 0] << 11 | fives[..., 1] << 5 | fives[..., 2]
data = dds(packed.astype("<u2").tobytes(), flags=0x40, bits=16, masks=(0xF800, 0x7E0, 0x1F, 0))
keep("b5g6r5.dds", data, np.floor(fives / [31, 63, 31] * 255 + 0.5).astype(int), 255)
shorts = np.round(normals[..., :2] * 32767).astype("<i2")
keep("rg16_signed.dds", dds(shorts.tobytes(), dxgi=37), shorts / 32767, 1)
codes = np.round(normals * 127).astype(np.int8)
data = dds(codes[..., :2].tobytes(), flags=0x80000, bits=16, masks=(0xFF, 0xFF00, 0, 0))
keep("v8u8.dds", data, codes[..., :2] / 127, 1)
halves = np.dstack([normals, alpha / 255]).astype("<f2")
keep("rgba16f.dds", dds(halves.tobytes(), four_cc=113), halves.astype(float), 1)

# WebP by libwebp, which decodes its own lossy files.
for name, picture, options in (
    ("lossless.webp", opaque, {"lossless": True}),
    ("lossless_alpha.webp", Image.fromarray(rgba), {"lossless": True, "exact": True}),
    ("lossy.webp", opaque, {"quality": 90}),
    ("lossy_alpha.webp", Image.fromarray(rgba), {"quality": 90, "exact": True}),
):
    out = io.BytesIO()
    picture.save(out, "WEBP", **options)
    mode = "RGBA" if "alpha" in name else "RGB"
    keep(name, out.getvalue(), by_pillow(out.getvalue(), mode), 255)

# KTX2 by ktx-parse, Basis Universal by its own encoder; both are told in base64, and say in base64.
tasks = {"width": WIDTH, "height": HEIGHT, "rgba": rgba.tobytes().hex(), "plain": {}}
# The map of crates/maps/tests/common, for the tests that go over all formats.
y, x = np.mgrid[0:7, 0:12]
common = np.stack([0.3 * np.sin(0.5 * x), 0.2 * np.cos(0.9 * y), np.ones_like(x, float)], -1)
common = np.round((common / np.linalg.norm(common, axis=-1, keepdims=True) + 1) * 127.5)
common = np.dstack([common.astype(np.uint8), np.full_like(x, 255, np.uint8)])
tasks["common"] = {"width": 12, "height": 7, "rgba": common.tobytes().hex()}


def plain(name, level, vk_format, values, **options):
    scheme = options.pop("zstd", False)
    stored = imagecodecs.zstd_encode(level, 19) if scheme else level
    tasks["plain"][name] = {"level": stored.hex(), "length": len(level), "format": vk_format, "zstd": scheme, **options}
    keep(name, None, *values)


plain("rgba8_zstd.ktx2", rgba.tobytes(), 37, (rgba, 255), zstd=True, bytes=1, channels=4)
plain("bc7.ktx2", bc7, 145, (by_pillow(dds(bc7, dxgi=98), "RGBA"), 255), model=134)
plain("rgba8_below.ktx2", rgba[::-1].tobytes(), 37, (rgba, 255), bytes=1, channels=4, keys={"KTXorientation": "ru"})
bgr1 = np.dstack([rgb[..., ::-1], alpha])
plain("rgba8_swizzle.ktx2", bgr1.tobytes(), 37, (rgb, 255), bytes=1, channels=4, keys={"KTXswizzle": "bgr1"})
modules = Path(sys.argv[1]).resolve()
said = subprocess.run(
    ["node", HERE / "textures.mjs", modules], input=json.dumps(tasks), stdout=subprocess.PIPE, text=True, check=True
)
for name, made in json.loads(said.stdout.splitlines()[-1]).items():
    data = bytes.fromhex(made["file"])
    if "values" not in made:
        (HERE / name).write_bytes(data)
        continue
    values = np.frombuffer(bytes.fromhex(made["values"]), np.uint8).reshape(HEIGHT, WIDTH, 4)
    keep(name, data, values[..., made["channels"]], 255)

lines = ",\n".join(f"{json.dumps(name)}: {json.dumps(case)}" for name, case in sorted(expected.items()))
(HERE / "textures.json").write_text("{\n" + lines + "\n}\n")
