"""How likely our fitted lobes make the normals, against independent fits of the same samples.

Run: python likelihood.py NDFMAP [BLOCKS]. Bakes built-in maps with `gmm:4:unaligned` and `vmf:4:unaligned` in single
precision, decodes texels with `inspect`, and compares the mean log-likelihood per normal with scikit-learn's
GaussianMixture (spherical, k-means start) and with the movMF of this file (a k-means++ start, as scikit-learn's, EM with exact normalisation).
Normals are read with OpenImageIO from an 8-bit picture that this script makes. Prints a JSON document.
"""

import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import OpenImageIO as oiio
from sklearn.mixture import GaussianMixture

SIDE, LOBES = 128, 4
# As many as our own fits have.
STARTS = 4
# What rounding to 8 bits leaves, (2/255)²/12: the floor of both programs, or equal normals would be infinitely likely.
FLOOR = 5e-6


def surface(kind, rng):
    """A normal map of a bumpy surface, as 8-bit values would hold it."""
    v, u = np.mgrid[0:SIDE, 0:SIDE] / SIDE * 2 * np.pi
    if kind == "waves":
        x = 0.5 * np.sin(5 * u + np.sin(3 * v)) + 0.2 * np.cos(11 * v)
        y = 0.5 * np.cos(4 * v + np.sin(2 * u)) + 0.1 * np.sin(13 * u)
    else:
        facets = rng.normal(0, 0.35, (16, 16, 2)).repeat(8, 0).repeat(8, 1)
        x, y = facets[..., 0], facets[..., 1]
    x, y = x + rng.normal(0, 0.05, x.shape), y + rng.normal(0, 0.05, y.shape)
    n = np.dstack([-x, -y, np.ones_like(x)])
    return np.round((n / np.linalg.norm(n, axis=2, keepdims=True) + 1) * 127.5).astype(np.uint8)


def run(program, *words):
    return json.loads(subprocess.run([program, *map(str, words), "--json"], check=True, capture_output=True).stdout)


def log_vmf(normals, mu, kappa):
    return np.log(kappa / (2 * np.pi)) - np.log1p(-np.exp(-2 * kappa)) + kappa * (normals @ mu - 1)


def log_gauss(points, mu, variance):
    return -np.log(2 * np.pi * variance) - ((points - mu) ** 2).sum(1) / (2 * variance)


def mean_log(logs, weights):
    joint = np.array(logs) + np.log(weights)[:, None]
    top = joint.max(0)
    return float((top + np.log(np.exp(joint - top).sum(0))).mean())


def movmf(normals, rng, starts, rounds=100):
    """EM for von Mises-Fisher mixtures (Banerjee et al. 2005), the most likely of several starts."""
    best = -np.inf
    for _ in range(starts):
        seeds = [normals[rng.integers(len(normals))]]
        for _ in range(LOBES - 1):
            far = np.min([((normals - s) ** 2).sum(1) for s in seeds], axis=0)
            seeds.append(normals[rng.choice(len(normals), p=far / far.sum())] if far.sum() > 0 else seeds[0])
        mu, kappa, alpha = np.array(seeds), np.full(LOBES, 50.0), np.full(LOBES, 1 / LOBES)
        for _ in range(rounds):
            joint = np.array([np.log(a) + log_vmf(normals, m, k) for a, m, k in zip(alpha, mu, kappa)])
            z = np.exp(joint - joint.max(0))
            z /= z.sum(0)
            alpha = np.maximum(z.mean(1), 1e-12)
            r = z @ normals / np.maximum(z.sum(1), 1e-12)[:, None]
            length = np.minimum(np.linalg.norm(r, axis=1), 1 - 1e-12)
            mu = r / np.maximum(length, 1e-12)[:, None]
            kappa = np.clip((3 * length - length**3) / (1 - length**2), 1e-3, 1 / FLOOR)
        best = max(best, mean_log([log_vmf(normals, m, k) for m, k in zip(mu, kappa)], alpha))
    return best


def main():
    program, blocks = sys.argv[1], int(sys.argv[2]) if len(sys.argv) > 2 else 12
    rng = np.random.default_rng(2005)
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        for kind in ("waves", "facets"):
            encoded = surface(kind, rng)
            picture = Path(folder) / f"{kind}.png"
            image = oiio.ImageBuf(np.ascontiguousarray(encoded))
            image.write(str(picture))
            normals = encoded.astype(np.float64) * 2 / 255 - 1
            normals /= np.linalg.norm(normals, axis=2, keepdims=True)
            for level in (3, 5):
                block = 2**level
                for method in ("gmm", "vmf"):
                    file = Path(folder) / "map.ktx2"
                    spelling = f"{method}:{LOBES}:unaligned"
                    run(program, "bake", picture, "-o", file, "-m", spelling, "--precision", "single", "--from", "normal", "--convention", "opengl")
                    ours, theirs, seconds = [], [], 0.0
                    for _ in range(blocks):
                        x, y = rng.integers(SIDE // block, size=2)
                        samples = normals[y * block : (y + 1) * block, x * block : (x + 1) * block].reshape(-1, 3)
                        lobes = run(program, "inspect", file, "--texel", level, x, y)["lobes"]
                        weights = [lobe["weight"] for lobe in lobes]
                        start = time.perf_counter()
                        if method == "gmm":
                            points = samples[:, :2]
                            fit = GaussianMixture(LOBES, covariance_type="spherical", reg_covar=FLOOR, random_state=0, n_init=STARTS)
                            fit.fit(points)
                            seconds += time.perf_counter() - start
                            logs = [log_gauss(points, m, v) for m, v in zip(fit.means_, fit.covariances_)]
                            theirs.append(mean_log(logs, fit.weights_))
                            logs = [
                                log_gauss(points, np.array(lobe["mean"]), max(lobe["variance"], FLOOR)) for lobe in lobes
                            ]
                        else:
                            theirs.append(movmf(samples, rng, starts=STARTS))
                            seconds += time.perf_counter() - start
                            logs = [
                                log_vmf(samples, np.array(lobe["mean"]), min(lobe["kappa"], 1 / FLOOR)) for lobe in lobes
                            ]
                        ours.append(mean_log(logs, weights))
                    rows.append(
                        {
                            "map": kind,
                            "level": level,
                            "method": method,
                            "ours": float(np.mean(ours)),
                            "independent": float(np.mean(theirs)),
                            "independent_ms": seconds / blocks * 1e3,
                        }
                    )
    json.dump(rows, sys.stdout, indent=1)


main()
