"""Reference values of methods' effective lobes (numpy and scipy), for crates/core/tests/methods.rs.

Run: python methods.py > methods.json. Ten texels of explicit normals, twenty directions, Blinn-Phong of
exponents 50 and 400 and Lambert. Each method's stored channels are worked out here, from its paper's
formulas, and so is what it makes of them; nothing is fitted.
"""

import functools
import json
import sys

import numpy as np
from scipy.integrate import quad
from scipy.special import eval_legendre, sph_harm_y
from scipy.stats import norm

LOBES = 3
ORDER = 7
EXPONENTS = (50, 400)


def blinn_phong(s, u):
    return (s + 1) / (2 * np.pi) * np.maximum(u, 0) ** s


def real_harmonics(order, n):
    theta, phi = np.arccos(np.clip(n[..., 2], -1, 1)), np.arctan2(n[..., 1], n[..., 0])
    out = []
    for l in range(order + 1):
        for m in range(-l, l + 1):
            y = sph_harm_y(l, abs(m), theta, phi)
            part = y.real if m >= 0 else y.imag
            # scipy has the Condon-Shortley phase, we do not.
            out.append(part if m == 0 else np.sqrt(2) * (-1) ** abs(m) * part)
    return np.stack(out, -1)


def float32(channels):
    """Channels as they are stored: what a method makes of them must be of the same numbers."""
    return np.asarray(channels, np.float32).astype(float)


def groups(normals):
    """A mixture's lobes: any partition will do, here by angle around the pole."""
    angle = np.arctan2(normals[:, 1], normals[:, 0])
    return np.array_split(np.argsort(angle), LOBES)


@functools.cache
def zonal(f, l):
    """Zonal coefficient of a lobe, by adaptive quadrature."""
    integrand = lambda t: f(0, np.cos(t)) * eval_legendre(l, np.cos(t)) * np.sin(t)
    return 2 * np.pi * quad(integrand, 0, np.pi / 2, points=[0.05, 0.2, 0.5], limit=400, epsabs=1e-13)[0]


def vmf(normals, series=False):
    channels = [[len(g) / len(normals), *(normals[g].mean(0) * [1, 1, 0] * len(g) / len(normals))[:2],
                 (1 - normals[g][:, 2]).mean() * len(g) / len(normals)] for g in groups(normals)]
    channels = float32(channels)

    def lobe(f, w):
        total = 0
        for a, x, y, z in channels:
            r = np.array([x / a, y / a, 1 - z / a])
            length = np.linalg.norm(r)
            # Banerjee et al. 2005; then Han et al.'s equation 20 for Blinn-Phong.
            kappa = (3 * length - length**3) / (1 - length**2)
            u = w @ (r / length)
            value = f(1 / kappa, u)
            if series and f is not lambert_lobe:
                # Han et al.'s zonal series of any BRDF, Lambda_l as printed for small angles.
                scale = [(2 * l + 1) / (4 * np.pi) * np.exp(-l * l / (2 * kappa)) * zonal(f, l) for l in range(17)]
                value = np.maximum(sum(s * eval_legendre(l, u) for l, s in enumerate(scale)), 0)
            total = total + a / channels[:, 0].sum() * value
        return total

    return channels, lobe


def gmm(normals, printed=False):
    channels = []
    for g in groups(normals):
        a, mu = len(g) / len(normals), normals[g][:, :2].mean(0)
        second = (normals[g][:, :2] ** 2).sum(1).mean()
        variance = (second - mu @ mu) / 2
        stored = variance + mu @ mu if printed else second
        channels.append([a, *(a * mu), a * stored])
    channels = float32(channels)

    def lobe(f, w):
        total = 0
        for a, x, y, q in channels:
            mu = np.array([x, y]) / a
            variance = (q / a - mu @ mu) / (1 if printed else 2)
            far = ((w[:, :2] - mu) ** 2).sum(1)
            above = w[:, 2] > 0
            if f is lambert_lobe:
                lifted = np.array([*mu, np.sqrt(1 - mu @ mu)])
                value = np.maximum(w @ lifted, 0) if printed else f(variance, w @ lifted)
            elif printed:
                v = variance + 1 / f.exponent
                value = np.where(above, np.exp(-far / (2 * v)) / (2 * np.pi * v), 0)
            else:
                value = np.where(above, f(variance, np.sqrt(np.maximum(1 - far, 0))), 0)
            total = total + a / channels[:, 0].sum() * value
        return total

    return channels, lobe


def phong(normals):
    peaks = [(0.5, normals[0], 30.0), (0.3, normals[5], 200.0), (0.2, normals[9], 8.0)]
    channels = float32([[w, n[0], n[1], e] for w, n, e in peaks])

    def lobe(f, w):
        mean = lambda x, y: np.array([x, y, np.sqrt(1 - x * x - y * y)])
        return sum(a * f(1 / e, w @ mean(x, y)) for a, x, y, e in channels)

    return channels, lobe


def sh(normals):
    channels = float32(real_harmonics(ORDER, normals).mean(0))

    def lobe(f, w):
        rho = np.concatenate([[zonal(f, l)] * (2 * l + 1) for l in range(ORDER + 1)])
        return np.maximum(real_harmonics(ORDER, w) @ (rho * channels), 0)

    return channels, lobe


def space(normals):
    p = normals - [0, 0, 1]
    second = np.einsum("ni,nj->ij", p, p) / len(p)
    xx, yy, zz, xy, xz, yz = second[0, 0], second[1, 1], second[2, 2], second[0, 1], second[0, 2], second[1, 2]
    x, y, z = p.mean(0)
    channels = float32([x, y, z, 1, xx, yy, zz, 1, xy, xz, yz, 1])
    x, y, z, _, xx, yy, zz, _, xy, xz, yz, _ = channels
    mean = np.array([x, y, z])
    covariance = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) - np.outer(mean, mean)
    return channels, mean + [0, 0, 1], covariance


def ndm(normals, kernel, tangent=None):
    channels, mean, covariance = space(normals)
    generators = {"gaussian": lambda d: np.exp(-d / 2), "pearson": lambda d: np.maximum(1 - d / 16, 0) ** 8}

    def lobe(f, w):
        if f is lambert_lobe:
            deviation = np.sqrt(np.einsum("wi,ij,wj->w", w, covariance, w))
            # Mean of the positive part of a Gaussian.
            t = w @ mean / deviation
            return deviation * (t * norm.cdf(t) + norm.pdf(t))
        s = f.exponent
        sigma = covariance + np.eye(3) / s
        if tangent is None:
            d = np.einsum("wi,ij,wj->w", w - mean, np.linalg.inv(sigma), w - mean)
            if kernel == "brdf":
                return f(0, 1 - d / (2 * s)) * np.sqrt(s**-3 / np.linalg.det(sigma))
            # The kernel's own lobe of a flat map integrates to one over the sphere.
            flat = 2 * np.pi * quad(lambda u: generators[kernel](2 * s * (1 - u)), -1, 1, points=[0.9, 0.99], epsabs=1e-15)[0]
            return generators[kernel](d) / flat * np.sqrt(s**-3 / np.linalg.det(sigma))
        # The plane mu·x = far, by conditioning; projected from the origin.
        length = np.linalg.norm(mean)
        mu = mean / length
        a = np.cross(mu, [0.3, 0.9, 0.1])
        a /= np.linalg.norm(a)
        axes = np.stack([a, np.cross(mu, a)])
        far = 1 if tangent else length
        across = axes @ sigma @ mu
        plane = axes @ sigma @ axes.T - np.outer(across, across) / (mu @ sigma @ mu)
        middle = across * (far - length) / (mu @ sigma @ mu)
        u = w @ mu
        place = (w @ axes.T) * (far / u)[:, None] - middle
        d = np.einsum("wi,ij,wj->w", place, np.linalg.inv(plane), place)
        onto = np.where(u > 0, far**2 / np.abs(u) ** 3, 0)
        # The BRDF's own profile: its lobe over slopes of its own variance, D cos^3, stretched.
        z = 1 / np.sqrt(1 + d / s)
        profile = f(0, z) * z**3 / s / np.sqrt(np.linalg.det(plane))
        return profile * onto

    return channels, lobe


def slopes(normals):
    p = -normals[:, :2] / normals[:, 2:]
    second = (p[:, 0] ** 2).mean(), (p[:, 1] ** 2).mean(), (p[:, 0] * p[:, 1]).mean()
    channels = float32([0, *p.mean(0), 1, *second, 1])
    _, x, y, _, xx, yy, xy, _ = channels
    covariance = np.array([[xx - x * x, xy - x * y], [xy - x * y, yy - y * y]])

    def lobe(f, w):
        s = f.exponent
        sigma = covariance + np.eye(2) / s
        d = -w[:, :2] / w[:, 2:] - [x, y]
        q = np.einsum("wi,ij,wj->w", d, np.linalg.inv(sigma), d)
        z = 1 / np.sqrt(1 + q / s)
        return np.where(w[:, 2] > 0, f(0, z) * z**3 / s / np.sqrt(np.linalg.det(sigma)) / np.abs(w[:, 2]) ** 3, 0)

    return channels, lobe


def stereographic(normals):
    p = normals[:, :2] / (1 + normals[:, 2:])
    second = (p[:, 0] ** 2).mean(), (p[:, 1] ** 2).mean(), (p[:, 0] * p[:, 1]).mean()
    channels = float32([*p.mean(0), *second, *normals.mean(0)])
    x, y, xx, yy, xy = channels[:5]
    covariance = np.array([[xx - x * x, xy - x * y], [xy - x * y, yy - y * y]])

    def lobe(f, w):
        if f is lambert_lobe:
            return np.maximum(w @ channels[5:], 0)
        v = 1 / f.exponent
        sigma = covariance + np.eye(2) * v / 4
        d = w[:, :2] / (1 + w[:, 2:]) - [x, y]
        q = np.einsum("wi,ij,wj->w", d, np.linalg.inv(sigma), d)
        # A flat map's integral, over the polar angle.
        flat = quad(lambda t: np.exp(-2 * np.tan(t / 2) ** 2 / v) * np.sin(t), 0, 3.1, points=[0.1, 0.3, 1], epsabs=1e-14)[0] * 4 / v
        return np.exp(-q / 2) / (2 * np.pi * np.sqrt(np.linalg.det(sigma))) / flat

    return channels, lobe


def widened(s):
    # Blinn-Phong of slope variance 1/s, widened by a variance.
    lobe = lambda by, u: blinn_phong(1 / (1 / s + by), u)
    lobe.exponent = s
    return lobe


def lambert_lobe(by, u):
    """Clamped cosine, convolved with a vMF lobe whose kappa is 1/by, by its series in Legendre polynomials."""
    if np.all(by == 0):
        return np.maximum(u, 0)
    kappa = 1 / by
    a = [1, 1 / np.tanh(kappa) - 1 / kappa] if kappa < 300 else [1, 1 - 1 / kappa]
    a.append(1 - 3 * a[1] / kappa)
    order = 60
    ratios = np.zeros(order + 60)
    for l in range(order + 58, 0, -1):
        ratios[l] = 1 / ((2 * l + 1) / kappa + ratios[l + 1])
    weights = np.cumprod(np.concatenate([[1.0], ratios[1:]]))
    total = 0
    for l in range(order + 1):
        rho, _ = quad(lambda x: x * eval_legendre(l, x), 0, 1, limit=200)
        total = total + (2 * l + 1) / 2 * rho * weights[l] * eval_legendre(l, u)
    return total


METHODS = {
    "vmf:3": vmf,
    "vmf:3:series": lambda n: vmf(n, series=True),
    "gmm:3": gmm,
    "gmm:3:printed": lambda n: gmm(n, printed=True),
    "phong:3": phong,
    "sh:7": sh,
    "ndm": lambda n: ndm(n, "brdf"),
    "ndm:gaussian": lambda n: ndm(n, "gaussian"),
    "ndm:pearson": lambda n: ndm(n, "pearson"),
    "ndm:plane": lambda n: ndm(n, "brdf", tangent=False),
    "ndm:tangent": lambda n: ndm(n, "brdf", tangent=True),
    "stereographic": stereographic,
    "slopes": slopes,
}


def main():
    rng = np.random.default_rng(1997)
    texels = []
    for k in range(10):
        centre = rng.normal(0, 0.3, 2)
        spread = rng.uniform(0.05, 0.3, 2)
        xy = np.clip(centre + rng.normal(0, 1, (16, 2)) * spread, -0.65, 0.65)
        n = np.column_stack([xy, np.sqrt(1 - (xy**2).sum(1))])
        texels.append(n)
    directions = rng.normal(size=(20, 3)) * [0.4, 0.4, 0.1] + [0, 0, 1]
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    lobes = {f"blinn-phong:{s}": widened(s) for s in EXPONENTS} | {"lambert": lambert_lobe}
    out = {"directions": directions.tolist(), "methods": {}}
    for name, method in METHODS.items():
        rows = []
        for normals in texels:
            channels, lobe = method(normals)
            # Lambert under slopes is a quadrature of ours, and sharp lobes ring under harmonics.
            wanted = [l for l in lobes if not (name == "slopes" and l == "lambert") and not (name == "sh:7" and l == "blinn-phong:400")]
            values = {l: np.broadcast_to(lobe(lobes[l], directions), 20).tolist() for l in wanted}
            rows.append({"channels": np.ravel(channels).tolist(), "lobes": values})
        out["methods"][name] = rows
    json.dump(out, sys.stdout)


main()
