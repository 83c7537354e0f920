"""CPU time and peak memory of `ndfmap bake` against `maketx --bumpslopes -d half`, taking turns.

Usage: bench_maketx.py NDFMAP [SIZE [RUNS]]. Needs numpy and OpenImageIO (requirements.txt).
"""

import os
import statistics
import sys
import tempfile
import time

import numpy as np
import OpenImageIO as oiio


def noise_map(size):
    """An 8-bit normal map of smooth random bumps: compresses about as real lossless maps do."""
    rng = np.random.default_rng(4096)
    v, u = np.mgrid[0:size, 0:size] / size * 2 * np.pi
    x, y = np.zeros((size, size)), np.zeros((size, size))
    for _ in range(12):
        p, q = rng.integers(-40, 41, 2)
        wave = np.cos(p * u + q * v + rng.uniform(0, 2 * np.pi))
        x, y = x + p * wave / 150, y + q * wave / 150
    x, y = x + rng.normal(0, 0.02, x.shape), y + rng.normal(0, 0.02, y.shape)
    n = np.stack([-x, -y, np.ones_like(x)], -1)
    n /= np.linalg.norm(n, axis=-1, keepdims=True)
    return np.round((n + 1) * 127.5).astype(np.uint8)


def write_png(path, pixels):
    height, width, channels = pixels.shape
    out = oiio.ImageOutput.create(path)
    assert out.open(path, oiio.ImageSpec(width, height, channels, "uint8")), oiio.geterror()
    assert out.write_image(np.ascontiguousarray(pixels))
    out.close()


def run(command):
    """(CPU seconds, wall seconds, peak MB) of a finished child, from the operating system."""
    start = time.monotonic()
    child = os.spawnv(os.P_NOWAIT, command[0], command)
    _, status, usage = os.wait4(child, 0)
    assert os.waitstatus_to_exitcode(status) == 0, command
    return usage.ru_utime + usage.ru_stime, time.monotonic() - start, usage.ru_maxrss / 1024


def main():
    ndfmap = sys.argv[1]
    size = int(sys.argv[2]) if len(sys.argv) > 2 else 4096
    runs = int(sys.argv[3]) if len(sys.argv) > 3 else 5
    maketx = os.path.join(os.path.dirname(sys.executable), "maketx")
    with tempfile.TemporaryDirectory() as folder:
        source = os.path.join(folder, "map.png")
        write_png(source, noise_map(size))

        def target(name):
            return os.path.join(folder, name)

        commands = {
            "maketx half exr": [maketx, "--bumpslopes", "-d", "half", "--format", "openexr", source, "-o", target("oiio.exr")],
            "ndfmap ktx2": [ndfmap, "bake", source, "-m", "slopes", "-o", target("map.ktx2"), "--zstd=0", "--json"],
            "ndfmap exr": [ndfmap, "bake", source, "-m", "slopes", "-o", target("map.exr"), "--layout", "bumpslopes", "--json"],
        }
        silent = os.open(os.devnull, os.O_WRONLY)
        saved = [os.dup(1), os.dup(2)]
        results = {name: [] for name in commands}
        for turn in range(runs + 1):
            for name, command in commands.items():
                for place in target("oiio.exr"), target("map.ktx2"), target("map.exr"):
                    if os.path.exists(place):
                        os.remove(place)
                os.dup2(silent, 1), os.dup2(silent, 2)
                measured = run(command)
                os.dup2(saved[0], 1), os.dup2(saved[1], 2)
                if turn > 0:  # the first warms the caches
                    results[name].append(measured)
        print(f"{size} x {size} 8-bit PNG of {os.path.getsize(source) / 2**20:.1f} MB to slopes in half floats, {runs} turns, medians")
        print(f"{'':16} {'CPU s':>8} {'wall s':>8} {'peak MB':>8}   CPU and memory of maketx over ours")
        base = [statistics.median(c) for c in zip(*results["maketx half exr"])]
        for name, measured in results.items():
            cpu, wall, peak = [statistics.median(c) for c in zip(*measured)]
            ratio = "" if name.startswith("maketx") else f"   {base[0] / cpu:.1f} x {base[2] / peak:.1f} x"
            print(f"{name:16} {cpu:8.2f} {wall:8.2f} {peak:8.0f}{ratio}")


main()
