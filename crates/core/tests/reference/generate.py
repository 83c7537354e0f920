"""Reference values from an independent implementation (numpy and scipy), for crates/core/tests/reference.rs.

Run: python generate.py > expected.json. Nothing here shares a formula with the Rust code where scipy has
its own: zonal coefficients by adaptive quadrature of the lobe, spherical harmonics from scipy's complex
ones, representations from plain moments of explicit normals.
"""

import json

import numpy as np
from scipy.integrate import quad
from scipy.special import eval_legendre, sph_harm_y

LOBES = {
    "lambert": lambda u: u,
    "blinn-phong:3": lambda u: 4 / (2 * np.pi) * u**3,
    "blinn-phong:50": lambda u: 51 / (2 * np.pi) * u**50,
    "torrance-sparrow:0.2": lambda u: np.exp(-np.arccos(u) ** 2 / (4 * 0.04)) / (4 * np.pi * 0.04),
    "beckmann:0.4": lambda u: np.exp(-(1 / u**2 - 1) / 0.16) / (np.pi * 0.16 * u**4) if u > 1e-3 else 0.0,
    "beckmann:0.1": lambda u: np.exp(-(1 / u**2 - 1) / 0.01) / (np.pi * 0.01 * u**4) if u > 1e-3 else 0.0,
    "ggx:0.4": lambda u: 0.16 / (np.pi * ((0.16 - 1) * u**2 + 1) ** 2),
    "ggx:0.1": lambda u: 0.01 / (np.pi * ((0.01 - 1) * u**2 + 1) ** 2),
}


def zonal(f, order):
    # The substitution u = cos t spreads narrow peaks; breakpoints help the adaptive rule find them.
    def term(l):
        integrand = lambda t: f(np.cos(t)) * eval_legendre(l, np.cos(t)) * np.sin(t)
        value, _ = quad(integrand, 0, np.pi / 2, points=[0.02, 0.1, 0.3, 0.8], limit=400, epsabs=1e-14, epsrel=1e-13)
        return 2 * np.pi * value

    return [term(l) for l in range(order + 1)]


def real_harmonic(l, m, n):
    theta, phi = np.arccos(np.clip(n[2], -1, 1)), np.arctan2(n[1], n[0])
    y = sph_harm_y(l, abs(m), theta, phi)
    # scipy has the Condon-Shortley phase, we do not.
    sign = (-1) ** abs(m)
    if m == 0:
        return float(y.real)
    return float(np.sqrt(2) * sign * (y.real if m > 0 else y.imag))


def slopes_lobe(normals, s, w):
    """LEAN's Gaussian of slopes widened by a Blinn-Phong lobe s, per map area, from explicit normals."""
    p = -normals[:, :2] / normals[:, 2:]
    mean, cov = p.mean(0), np.cov(p.T, bias=True) + np.eye(2) / s
    d = -w[:2] / w[2] - mean
    q = d @ np.linalg.solve(cov, d) / s
    u = 1 / np.sqrt(1 + q)
    return float((s + 1) / (2 * np.pi) * u**s * u**3 / (s * np.sqrt(np.linalg.det(cov))) / w[2] ** 3)


def toksvig_lobe(normals, s, w):
    mean = normals.mean(0)
    length = np.linalg.norm(mean)
    ft = length / (length + s * (1 - length))
    return float((1 + ft * s) / (2 * np.pi) * max(w @ mean / length, 0) ** (ft * s))


def gaussian_lobe(normals, s, w):
    """Olano and North: partial normalisation, Gaussian kernel, initial covariance I/s."""
    mean, cov = normals.mean(0), np.cov(normals.T, bias=True) + np.eye(3) / s
    d = (w - mean) @ np.linalg.solve(cov, w - mean)
    flat = 2 * np.pi / s * (1 - np.exp(-2 * s))
    return float(np.exp(-d / 2) / flat * np.sqrt(s**-3 / np.linalg.det(cov)))


def main():
    rng = np.random.default_rng(2007)
    directions = rng.normal(size=(6, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    normals = np.concatenate([rng.normal([0.3, 0.1], 0.15, (20, 2)), rng.normal([-0.2, 0.0], 0.1, (12, 2))])
    normals = np.column_stack([normals, np.ones(len(normals))])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    w = np.array([0.2, -0.1, 0.9])
    w /= np.linalg.norm(w)
    harmonics = [[real_harmonic(l, m, n) for l in range(17) for m in range(-l, l + 1)] for n in directions]
    truth = float(np.mean(51 / (2 * np.pi) * np.maximum(normals @ w, 0) ** 50))
    json.dump(
        {
            "zonal": {name: zonal(f, 16) for name, f in LOBES.items()},
            "directions": directions.tolist(),
            "harmonics": harmonics,
            "normals": normals.tolist(),
            "w": w.tolist(),
            "blinn-phong:50": {
                "truth": truth,
                "toksvig": toksvig_lobe(normals, 50, w),
                "slopes": slopes_lobe(normals, 50, w),
                "ndm:gaussian": gaussian_lobe(normals, 50, w),
            },
        },
        __import__("sys").stdout,
        indent=1,
    )


main()
