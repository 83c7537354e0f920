"""Our truth against Mitsuba 3: a normal-mapped square, Beckmann and GGX, a directional light, many samples.

Usage: mitsuba_plane.py NDFMAP. Prints a JSON list of {lobe, light, mean, l2, noise}: relative difference of the mean radiance,
relative L2 difference of the pictures, and the noise that the two pictures together should show (from two halves of each).

Made the same: no shadowing by the normal map (Mitsuba's `use_shadowing_function` and `flip_invalid_normals` off), reflectance 1,
nearest texels. Different, and stated: ours blends between texels, which at 21 texels a pixel moves their edges by half of one.
"""

import json
import subprocess
import sys
import tempfile
from pathlib import Path

import mitsuba as mi
import numpy as np

mi.set_variant("scalar_rgb")

SIDE, MAP, SAMPLES = 48, 1024, 512
LIGHTS = {"high": (0.3, 0.2, 0.9), "low": (-0.8, 0.3, 0.45)}


def normal_map(folder):
    """Smooth random bumps, tiling, in no way symmetric; as 8-bit normals."""
    random = np.random.default_rng(4)
    y, x = np.mgrid[0:MAP, 0:MAP] / MAP
    slope = np.zeros((2, MAP, MAP))
    for _ in range(24):
        k = random.integers(-9, 10, 2)
        wave = np.cos(2 * np.pi * (k[0] * x - k[1] * y) + random.uniform(0, 2 * np.pi))
        slope += 0.09 * wave * (k / max(np.hypot(*k), 1.0))[:, None, None]
    # A lean to one side, so that a flipped or transposed map cannot pass.
    slope += np.array([0.15, -0.1])[:, None, None] * (x + 0.5 * (1 - y) > 0.7)
    n = np.stack([-slope[0], -slope[1], np.ones((MAP, MAP))], axis=-1)
    n /= np.linalg.norm(n, axis=-1, keepdims=True)
    stored = np.round((n + 1) * 127.5).astype(np.uint8)
    # Mitsuba's first row of a picture lies at v = 0, which is the lower edge of its rectangle.
    for name, rows in [("ours.png", stored), ("theirs.png", stored[::-1])]:
        mi.Bitmap(np.ascontiguousarray(rows)).write(str(folder / name))


def theirs(folder, distribution, alpha, light, seed):
    towards = np.array(light) / np.linalg.norm(light)
    scene = mi.load_dict(
        {
            "type": "scene",
            "integrator": {"type": "path", "max_depth": 2, "hide_emitters": True},
            "sensor": {
                "type": "perspective",
                "fov": 35.0,
                "fov_axis": "y",
                "to_world": mi.ScalarTransform4f().look_at(origin=[0, 0, 4], target=[0, 0, 0], up=[0, 1, 0]),
                "film": {
                    "type": "hdrfilm",
                    "width": SIDE,
                    "height": SIDE,
                    "rfilter": {"type": "box"},
                    "component_format": "float32",
                },
                "sampler": {"type": "independent", "sample_count": SAMPLES},
            },
            "light": {
                "type": "directional",
                "direction": (-towards).tolist(),
                "irradiance": {"type": "rgb", "value": 1.0},
            },
            "square": {
                "type": "rectangle",
                "bsdf": {
                    "type": "normalmap",
                    "use_shadowing_function": False,
                    "flip_invalid_normals": False,
                    "normalmap": {"type": "bitmap", "filename": str(folder / "theirs.png"), "raw": True, "filter_type": "nearest"},
                    "bsdf": {
                        "type": "roughconductor",
                        "material": "none",
                        "distribution": distribution,
                        "alpha": alpha,
                    },
                },
            },
        }
    )
    return np.array(mi.render(scene, seed=seed, spp=SAMPLES))[..., 0]


def ours(program, folder, lobe, light):
    picture = folder / "ours.exr"
    words = [program, "render", "--scene", "v-groove", "--map", folder / "ours.png", "--from", "normal", "--convention", "opengl", "--size", str(SIDE), "--brdf", lobe]
    words += ["--model", "smith", "--diffuse", "0", "--specular", "1", "--light", ",".join(map(str, light)) + ":1"]
    words += ["--method", "naive", f"--truth={2 * SAMPLES}", "--truth-output", picture, "--json"]
    told = json.loads(subprocess.run(list(map(str, words)), check=True, capture_output=True).stdout)
    return np.array(mi.Bitmap(str(picture)))[..., 0], told["truth"]["noise"]


def main():
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        folder = Path(folder)
        normal_map(folder)
        for distribution, alpha in [("beckmann", 0.2), ("ggx", 0.25)]:
            for name, light in LIGHTS.items():
                mine, noise = ours(sys.argv[1], folder, f"{distribution}:{alpha}", light)
                halves = [theirs(folder, distribution, alpha, light, seed) for seed in (1, 2)]
                other = (halves[0] + halves[1]) / 2
                # The square reaches 19.03 pixels from the middle; its outline shows our background.
                inside = np.s_[SIDE // 2 - 18 : SIDE // 2 + 18, SIDE // 2 - 18 : SIDE // 2 + 18]
                norm = np.linalg.norm(other[inside])
                their_noise = np.linalg.norm((halves[0] - halves[1])[inside]) / 2 / norm
                rows.append(
                    {
                        "lobe": f"{distribution}:{alpha}",
                        "light": name,
                        "mean": float(abs(mine[inside].mean() / other[inside].mean() - 1)),
                        "l2": float(np.linalg.norm((mine - other)[inside]) / norm),
                        "noise": float(np.hypot(noise, their_noise)),
                    }
                )
    print(json.dumps(rows))


main()
