"""Our `slopes` EXR against OpenImageIO's `maketx --bumpslopes`, channel by channel, level by level.

Usage: bumpslopes.py NDFMAP [MAP ...]. Makes its own maps; any MAP is compared too (lossless ones: two JPEG
decoders differ by a step or two). Prints one line a
comparison with the largest differences, and exits 1 if one exceeds its tolerance.

Tolerances. Single precision: both sides add the same numbers in another order, 1e-5 of a channel's largest
value on the finest level. Half floats besides: each side rounds its sum once, and two sums on either side of a
rounding boundary end a whole step apart, 2^-10 of the value or, below 2^-14, the fixed step 2^-24. Coarse
levels are compared where every size halves: at odd sizes OpenImageIO resamples with a box of its own, which
is no exact area mean. Left out are texels whose slope exceeds 10, which we hold to 10, and those at or below
the horizon (black ones too, which we take for (0,0,1)), where -n.xy/n.z of OpenImageIO changes sign; and every coarse texel that covers one. With --wrap
clamp edges agree too: OpenImageIO clamps slopes at edges whatever the wrap.
"""

import os
import subprocess
import sys
import tempfile

import numpy as np
import OpenImageIO as oiio

CHANNELS = ("b0_h", "b1_dhds", "b2_dhdt", "b3_dhds2", "b4_dhdt2", "b5_dh2dsdt")


def write(path, pixels, kind):
    pixels = np.ascontiguousarray(pixels if pixels.ndim == 3 else pixels[..., None])
    height, width, channels = pixels.shape
    out = oiio.ImageOutput.create(path)
    assert out.open(path, oiio.ImageSpec(width, height, channels, kind)), oiio.geterror()
    assert out.write_image(pixels), out.geterror()
    out.close()


def read(path):
    """All levels of the six channels, by name."""
    levels, level = [], 0
    image = oiio.ImageInput.open(path)
    while image.seek_subimage(0, level):
        spec = image.spec()
        order = [spec.channelnames.index(name) for name in CHANNELS]
        levels.append(np.asarray(image.read_image("float"))[..., order])
        level += 1
    image.close()
    return levels


def compare(ndfmap, folder, source, precision, options, oiio_options, convention=("--convention", "opengl")):
    theirs, ours = os.path.join(folder, "oiio.exr"), os.path.join(folder, "ours.exr")
    maketx = os.path.join(os.path.dirname(sys.executable), "maketx")
    kind = {"half": "half", "single": "float"}[precision]
    subprocess.run([maketx, "--bumpslopes", "-d", kind, "--format", "openexr", "--wrap", "clamp", *oiio_options, source, "-o", theirs], check=True, capture_output=True)
    subprocess.run([ndfmap, "bake", source, "-o", ours, "-m", "slopes", "--layout", "bumpslopes", "--precision", precision, "--wrap", "clamp", *options, *convention, "--json"], check=True, capture_output=True)
    a, b = read(theirs), read(ours)
    assert len(a) == len(b), (len(a), len(b))
    steep = ~np.isfinite(a[0]).all(-1)
    if (a[0][..., 0] == -1).all():
        pixels = oiio.ImageInput.open(source).read_image("float")
        steep |= (pixels[..., 2] * 2 - 1 <= 0) | (pixels[..., :3] == 0).all(-1) | (np.abs(np.nan_to_num(a[0][..., 1:3])).max(-1) > 9.99)
    left_out = 100 * float(steep.mean())
    finest = np.abs(a[0][~steep]).max(0)
    worst, levels = 0.0, 0
    for level, (x, y) in enumerate(zip(a, b)):
        assert x.shape == y.shape, (level, x.shape, y.shape)
        if level:
            height, width = a[level - 1].shape[:2]
            if (height, width) != (2 * x.shape[0], 2 * x.shape[1]):
                break
            steep = steep[0::2, 0::2] | steep[1::2, 0::2] | steep[0::2, 1::2] | steep[1::2, 1::2]
        if steep.all():
            break
        x, y = x[~steep], y[~steep]
        allowed = 1e-5 * np.maximum(finest, 1e-12) + (2.0**-10 * np.abs(x) + 2.0**-24 if precision == "half" else 0)
        worst = max(worst, float((np.abs(x - y) / allowed).max()))
        levels += 1
    ok = worst <= 1
    name = os.path.basename(source)
    print(f"{'ok ' if ok else 'BAD'} {name:44} {precision:6} {levels:2} levels, {left_out:.2f} % left out, worst {worst:.3f} of the tolerance, {' '.join(oiio_options)}")
    return ok


def main():
    ndfmap, maps = sys.argv[1], sys.argv[2:]
    rng = np.random.default_rng(1)
    v, u = np.mgrid[0:64, 0:128] / 64 * 2 * np.pi
    heights = 0.5 + 0.2 * np.sin(2 * u + v) + 0.1 * np.cos(3 * v - u) + 0.05 * rng.random((64, 128))
    n = np.stack([-np.cos(2 * u + v), 0.7 * np.sin(3 * v), np.full_like(u, 1.5)], -1) + rng.normal(0, 0.1, (64, 128, 3))
    n /= np.linalg.norm(n, axis=-1, keepdims=True)
    ok = True
    with tempfile.TemporaryDirectory() as folder:
        def made(name, pixels, kind):
            path = os.path.join(folder, name)
            write(path, pixels, kind)
            return path

        normal = made("normal.png", np.round((n + 1) * 127.5).astype(np.uint8), "uint8")
        height16 = made("height16.png", np.round(heights * 65535).astype(np.uint16), "uint16")
        height32 = made("height.exr", heights.astype(np.float32), "float")
        odd = made("odd.png", np.round(heights[:45, :77] * 255).astype(np.uint8), "uint8")
        for precision in "single", "half":
            for filter_ours, filter_theirs in ("sobel", "sobel"), ("central", "centraldiff"):
                for source in height16, height32, odd:
                    # Height scale must not matter: the file holds heights in the source's units.
                    ok &= compare(ndfmap, folder, source, precision, ["--slope-filter", filter_ours, "--height-scale", "0.003"], ["--slopefilter", filter_theirs, "--bumpformat", "height"])
            ok &= compare(ndfmap, folder, normal, precision, [], ["--bumpformat", "normal"])
            ok &= compare(ndfmap, folder, normal, precision, [], ["--bumpformat", "normal"], ("--convention", "directx"))
        for path in maps:
            is_height = os.path.basename(os.path.dirname(path)) == "height"
            kind = "height" if is_height else "normal"
            options = ["--from", kind] + (["--slope-filter", "sobel", "--height-scale", "0.001"] if is_height else [])
            for precision in "single", "half":
                ok &= compare(ndfmap, folder, path, precision, options, ["--bumpformat", kind])

        # A file of OpenImageIO's own, read by us: the mean slope of the coarsest texel.
        import json

        theirs = os.path.join(folder, "read.exr")
        maketx = os.path.join(os.path.dirname(sys.executable), "maketx")
        subprocess.run([maketx, "--bumpslopes", "-d", "float", "--bumpformat", "normal", normal, "-o", theirs, "--format", "openexr"], check=True, capture_output=True)
        told = json.loads(subprocess.run([ndfmap, "inspect", theirs, "--texel", "7", "0", "0", "--json"], check=True, capture_output=True).stdout)
        six = read(theirs)[7][0, 0]
        mean, cov = told["mean"], told["covariance"]
        expected = [six[1], six[2], six[3] - six[1] ** 2, six[4] - six[2] ** 2, six[5] - six[1] * six[2]]
        got = [mean[0], mean[1], cov[0][0], cov[1][1], cov[0][1]]
        same = np.allclose(got, expected, atol=1e-6)
        print("ok " if same else "BAD", "maketx's own file, read: mean and covariance", np.round(got, 5))
        ok &= bool(same)
    sys.exit(0 if ok else 1)


main()
