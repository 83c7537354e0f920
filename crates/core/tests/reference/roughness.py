"""Reference values of roughness mips (numpy and scipy), for crates/core/tests/roughness.rs.

Run: python roughness.py > roughness.json. Ten maps of 8 x 8 normals and roughness; of the one texel above them

- the mean normal's length, and what each engine's formula makes of it;
- the alpha of the GGX lobe about the mean normal that meets the azimuth average of the 64 lobes best, in the
  squares of the power 1/4 or 1/2 of brightness, by the solid angle and cosine of half-vectors: quadrature over
  600 angles and 512 azimuths, minimised by Brent's method.
"""

import json

import numpy as np
from scipy.optimize import minimize_scalar

rng = np.random.default_rng(2005)


def normalised(v):
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


def ggx(u, alpha):
    u2 = np.clip(u, 0, 1) ** 2
    return np.where(u > 0, alpha**2 / np.pi / ((alpha**2 - 1) * u2 + 1) ** 2, 0)


nodes, node_weights = np.polynomial.legendre.leggauss(600)
# Angles from the mean, dense near it.
t = (nodes + 1) / 2
THETA = t**3 * np.pi / 2
WEIGHT = node_weights / 2 * 3 * t**2 * np.pi / 2 * np.sin(THETA) * np.cos(THETA)
PHI = (np.arange(512) + 0.5) / 512 * np.pi


def average(normals, roughness):
    mean = normalised(normals.mean(0))
    total = np.zeros_like(THETA)
    for n, r in zip(normals, roughness):
        c = np.clip(n @ mean, -1, 1)
        s = np.sqrt(1 - c * c)
        u = s * np.sin(THETA)[:, None] * np.cos(PHI) + c * np.cos(THETA)[:, None]
        total += ggx(u, r * r).mean(1)
    return total / len(normals)


def fitted(seen, power):
    def error(log_alpha):
        return (WEIGHT * (seen**power - ggx(np.cos(THETA), np.exp(log_alpha)) ** power) ** 2).sum()

    grid = np.linspace(np.log(0.003), 0, 200)
    best = grid[np.argmin([error(a) for a in grid])]
    found = minimize_scalar(error, bounds=(best - 0.1, min(best + 0.1, 0)), method="bounded", options={"xatol": 1e-9})
    return float(np.sqrt(np.exp(found.x)))


def inverse_kappa(length):
    return (1 - length**2) / (3 * length - length**3)


def rules(length, r):
    k, a2 = inverse_kappa(length), r**4
    variance = max(0, (1 - length) / length - 4e-5)
    b = 2 * variance * (a2 - 1)
    return {
        "plain": r,
        "kappa": min(1, (a2 + 2 * k) ** 0.25),
        "unreal": ((b - a2) / (b - 1)) ** 0.25,
        "filament": min(1, (r * r + 2 * k) ** 0.5),
        "unity": min(1, (a2 + min(0.5 * k, 1 / 16)) ** 0.25),
        "godot": min(1, (r * r + min(0.75 * k, 0.16)) ** 0.5),
    }


maps = []
for i in range(10):
    spread = [0.02, 0.05, 0.1, 0.2, 0.3, 0.5, 0.1, 0.2, 0.4, 0.15][i]
    if i < 6:
        slopes = rng.normal(0, spread, (64, 2))
    else:
        # Bevels: flat, but for a share that leans one way.
        slopes = np.where(rng.random((64, 1)) < 0.3, spread * 3, 0.0) * np.array([1.0, 0.3]) + rng.normal(0, 0.01, (64, 2))
    normals = np.asarray(normalised(np.concatenate([-slopes, np.ones((64, 1))], 1)), np.float32).astype(float)
    roughness = np.asarray(np.clip(rng.normal([0.2, 0.3, 0.4, 0.5][i % 4], 0.03, 64), 0.1, 1), np.float32).astype(float)
    mean = normals.mean(0)
    seen = average(normals, roughness)
    maps.append({
        "normals": normals.flatten().tolist(), "roughness": roughness.tolist(), "length": float(np.linalg.norm(mean)),
        "rules": rules(float(np.linalg.norm(mean)), float(roughness.mean())),
        "fit": {"0.25": fitted(seen, 0.25), "0.5": fitted(seen, 0.5)},
    })
json.dump(maps, __import__("sys").stdout)
print()
