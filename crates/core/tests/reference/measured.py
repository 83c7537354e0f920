"""Reference values of measured materials (numpy), for crates/core/tests/measured.rs.

Run: python measured.py > measured.json. Shifted-gamma (Bagher, Soler and Holzschuch 2012) and ABC (Low,
Kronander, Ynnerman and Unger 2012) from the published numbers, written anew; and the least error that
`kd + f(theta_h) g(theta_d)` leaves of a table of 90 x 90 x 16 values, in each channel, by plain alternation
over the whole table rather than over its means.
"""

import csv
import json
import pathlib
import sys

import numpy as np

FITS = pathlib.Path(__file__).parents[2] / "src" / "brdf" / "measured"
MATERIALS = ["pink-felt", "blue-fabric", "gold-metallic-paint", "white-paint", "nickel", "chrome", "specular-red-phenolic"]


def numbers(name, file, skip):
    with open(FITS / file) as rows:
        row = next(r for r in csv.reader(rows) if r[0] == name)
    return np.array([float(x) for x in row[skip:]])


def sgd(name, wi, wo):
    values = numbers(name, "merl_sgd_fits.csv", 2)[:33].reshape(11, 3)
    rho_d, rho_s, alpha, p, f0, f1, kap, lam, c, k, theta0 = values[:, :, None]
    wh = wi + wo
    wh = wh / np.linalg.norm(wh, axis=-1, keepdims=True)
    tan2 = 1 / wh[..., 2] ** 2 - 1
    shifted = alpha + tan2 / alpha
    slopes = kap * np.exp(-shifted) / shifted**p
    d = slopes / (np.pi * wh[..., 2] ** 4)
    cosine = np.sum(wi * wh, -1)
    fresnel = f0 - f1 * cosine + (1 - f0) * (1 - cosine) ** 5

    def g1(w):
        past = np.maximum(np.arccos(np.clip(w[..., 2], -1, 1)) - theta0, 0)
        return np.clip(1 + lam * (1 - np.exp(c * past**k)), 0, 1)

    specular = fresnel * d * g1(wi) * g1(wo) / (wi[..., 2] * wo[..., 2])
    return np.maximum((rho_d + rho_s * specular) / np.pi, 0)


def abc(name, wi, wo):
    values = numbers(name, "merl_abc_fits.csv", 1)
    kd, a = values[:3, None], values[3:6, None]
    b, c, ior = values[6:9]
    wh = wi + wo
    wh = wh / np.linalg.norm(wh, axis=-1, keepdims=True)
    cosine = np.sum(wi * wh, -1)
    # Snell and Fresnel, polarisations apart.
    inside = np.sqrt(1 - (1 - cosine**2) / ior**2)
    s = (cosine - ior * inside) / (cosine + ior * inside)
    p = (ior * cosine - inside) / (ior * cosine + inside)
    fresnel = (s**2 + p**2) / 2
    d = a / (1 + b * (1 - wh[..., 2])) ** c
    g = np.minimum(1, 2 * wh[..., 2] * np.minimum(wi[..., 2], wo[..., 2]) / cosine)
    return kd / np.pi + fresnel * d * g / (np.pi * wi[..., 2] * wo[..., 2])


def table():
    """Directions and what each counts, theta_h by theta_d by phi_d."""
    edges = (np.arange(91) / 90) ** 2 * np.pi / 2
    h = (((np.arange(90) + 0.5) / 90) ** 2 * np.pi / 2)[:, None, None]
    d = ((np.arange(90) + 0.5) / 90 * np.pi / 2)[None, :, None]
    phi = ((np.arange(16) + 0.5) / 16 * np.pi)[None, None, :]
    h, d, phi = np.broadcast_arrays(h, d, phi)
    difference = np.stack([np.sin(d) * np.cos(phi), np.sin(d) * np.sin(phi), np.cos(d)], -1)

    def turned(v):
        return np.stack([np.cos(h) * v[..., 0] + np.sin(h) * v[..., 2], v[..., 1], np.cos(h) * v[..., 2] - np.sin(h) * v[..., 0]], -1)

    wi, wo = turned(difference), turned(difference * [-1, -1, 1])
    solid = np.sin(h) * np.diff(edges)[:, None, None] * np.sin(d)
    weight = np.where((wi[..., 2] > 0) & (wo[..., 2] > 0), solid * (wi[..., 2] * wo[..., 2]) ** 2, 0)
    return wi, wo, weight


def residual(name):
    wi, wo, weight = table()
    with np.errstate(all="ignore"):
        values = np.nan_to_num(sgd(name, wi.reshape(-1, 3), wo.reshape(-1, 3)), posinf=0).reshape(3, 90, 90, 16)
    left = total = 0
    for value in values:
        value = np.where(weight > 0, value, 0)
        kd, f, g = np.quantile(value[weight > 0], 0.1), np.zeros(90), np.ones(90)
        for turn in range(4000):
            rest = value - kd
            f = np.maximum(np.einsum("hdp,hdp,d->h", weight, rest, g) / np.maximum(np.einsum("hdp,d->h", weight, g**2), 1e-300), 0)
            g = np.maximum(np.einsum("hdp,hdp,h->d", weight, rest, f) / np.maximum(np.einsum("hdp,h->d", weight, f**2), 1e-300), 0)
            if turn > 20:
                kd = max(np.sum(weight * (value - np.outer(f, g)[..., None])) / np.sum(weight), 0)
        left += np.sum(weight * (value - kd - np.outer(f, g)[..., None]) ** 2)
        total += np.sum(weight * value**2)
    return float(np.sqrt(left / total))


def main():
    rng = np.random.default_rng(2012)
    wi, wo = rng.normal(size=(2, 12, 3))
    # Six pairs near the mirror, where highlights are.
    wo[:6] = wi[:6] * [-1, -1, 1] + 0.1 * rng.normal(size=(6, 3))
    wi[:, 2], wo[:, 2] = np.abs(wi[:, 2]) + 0.3, np.abs(wo[:, 2]) + 0.3
    wi, wo = (w / np.linalg.norm(w, axis=-1, keepdims=True) for w in (wi, wo))
    of = lambda fit, name: fit(name, wi, wo).T.tolist()
    json.dump(
        {
            "wi": wi.tolist(),
            "wo": wo.tolist(),
            "sgd": {name: of(sgd, name) for name in MATERIALS},
            "abc": {name: of(abc, name) for name in MATERIALS},
            "residual": {name: residual(name) for name in MATERIALS},
        },
        sys.stdout,
        indent=1,
    )


main()
