"""Reference values of shaded texels (numpy and scipy), for crates/core/tests/shaded.rs.

Run: python shaded.py > shaded.json. Ten texels and twenty paths of light, of

- displaced surfaces by LEADR: specular facets under a point light (Dupuy et al., section 3.3), masked and
  shadowed, with Lambda as the Gaussian integral that it is; diffuse facets by the mean over 5 x 5 slopes
  (section 3.6), with its artificial normal (section 3.7);
- mixtures of three von Mises-Fisher lobes in an environment that is a polynomial of order 2: irradiance by
  exact zonal factors (Han et al., equation 25), and their equation 26 to order 8 by quadrature;
- that environment as facets of five roughnesses blur it, seen straight on (Karis 2013): D of the half-vector
  over the mirror's directions, each by its cosine, by the lobe's zonal factors.
"""

import json

import numpy as np
from scipy.special import eval_legendre, sph_harm_y
from scipy.stats import norm

rng = np.random.default_rng(2013)
TEXELS, PATHS, ORDER = 10, 20, 8


def normalised(v):
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


def float32(values):
    """Numbers as they are stored."""
    return np.asarray(values, np.float32).astype(float)


# Paths: light and eye in the upper hemisphere, not at grazing angles, where all is divided by little.
def upper(count):
    z = rng.uniform(0.3, 0.98, count)
    phi = rng.uniform(0, 2 * np.pi, count)
    r = np.sqrt(1 - z * z)
    return np.stack([r * np.cos(phi), r * np.sin(phi), z], -1)


lights, eyes = upper(PATHS), upper(PATHS)
halves = normalised(lights + eyes)

# Slopes: channels are height, mean x and y, 1, and E[xx], E[yy], E[xy], 0 or whatever the method ignores.
means = float32(rng.uniform(-0.3, 0.3, (TEXELS, 2)))
spread = rng.uniform(0.02, 0.3, (TEXELS, 2)) ** 2
turn = rng.uniform(-0.6, 0.6, TEXELS) * np.sqrt(spread[:, 0] * spread[:, 1])
seconds = float32(np.stack([spread[:, 0] + means[:, 0] ** 2, spread[:, 1] + means[:, 1] ** 2, turn + means[:, 0] * means[:, 1]], -1))
covariances = seconds - np.stack([means[:, 0] ** 2, means[:, 1] ** 2, means[:, 0] * means[:, 1]], -1)
stretches = np.array([np.eye(2) if i % 2 == 0 else np.array([[1.3, 0.2], [-0.1, 0.8]]) for i in range(TEXELS)])
ALPHA = 0.2  # Beckmann: slope variance alpha^2 / 2 on an axis


def stretched(mean, covariance, by):
    full = np.array([[covariance[0], covariance[2]], [covariance[2], covariance[1]]])
    return by @ mean, by @ full @ by.T


def projected(mean, covariance, w):
    """Projected area of the mean normal, and the deviation of single facets'."""
    return w[2] - mean @ w[:2], np.sqrt(w[:2] @ covariance @ w[:2])


def seen(mean, covariance, w):
    """E[max(w.z - slope . w.xy, 0)], the facets that face w."""
    a, s = projected(mean, covariance, w)
    return a * norm.cdf(a / s) + s * norm.pdf(a / s)


def artificial(mean, wo):
    n = normalised(np.array([-mean[0], -mean[1], 1.0]))
    n = normalised(n - 1.01 * (n @ wo) * wo)
    return n, 1e-5 * max(n @ wo, 1e-6)


def specular(mean, covariance, wi, wo, wh, shadowed):
    """Section 3.3, of area seen: D / (4 a (1 + Lambda(wo) + Lambda(wi))); F = 1."""
    wide = covariance + np.eye(2) * ALPHA**2 / 2
    at = -wh[:2] / wh[2] - mean
    density = np.exp(-0.5 * at @ np.linalg.solve(wide, at)) / (2 * np.pi * np.sqrt(np.linalg.det(wide)))
    area = seen(mean, wide, wo)
    if shadowed:
        a_wo, a_wi = projected(mean, wide, wo)[0], projected(mean, wide, wi)[0]
        if a_wi <= 0:
            return 0.0
        area += max(a_wo, 0) * max(seen(mean, wide, wi) / a_wi - 1, 0)
    return density / wh[2] ** 4 / 4 / area


def diffuse(mean, covariance, wi, wo):
    """Section 3.6 with `L <n, wi>`, over pi, for an albedo of 1."""
    p = np.array([-1.8, -0.9, 0.0, 0.9, 1.8])
    w = np.exp(-0.5 * p * p)
    w /= w.sum()
    sx, sy = np.sqrt(covariance[0, 0]), np.sqrt(covariance[1, 1])
    r = covariance[0, 1] / (sx * sy)
    total = lit = 0.0
    for i in range(5):
        for j in range(5):
            x = mean[0] + p[i] * sx
            y = mean[1] + (p[i] * r + p[j] * np.sqrt(1 - r * r)) * sy
            n = normalised(np.array([-x, -y, 1.0]))
            visible = w[i] * w[j] * max(n @ wo, 0) / n[2]
            total += visible
            lit += visible * max(n @ wi, 0)
    n, visible = artificial(mean, wo)
    return (lit + visible * max(n @ wi, 0)) / (total + visible) / np.pi


slopes = []
for mean, second, covariance, by in zip(means, seconds, covariances, stretches):
    m, c = stretched(mean, covariance, by)
    each = lambda f: [f(m, c, wi, wo, wh) for wi, wo, wh in zip(lights, eyes, halves)]
    slopes.append({
        "mean": mean.tolist(), "second": second.tolist(), "stretch": by.T.flatten().tolist(),
        "masked": each(lambda m, c, wi, wo, wh: specular(m, c, wi, wo, wh, False)),
        "shadowed": each(lambda m, c, wi, wo, wh: specular(m, c, wi, wo, wh, True)),
        "diffuse": each(lambda m, c, wi, wo, wh: diffuse(m, c, wi, wo)),
    })


def radiance(w):
    """An environment of order 2, positive everywhere."""
    x, y, z = w[..., 0], w[..., 1], w[..., 2]
    return 1 + 0.5 * y + 0.3 * z + 0.4 * x * z


def harmonics(order, n):
    theta, phi = np.arccos(np.clip(n[..., 2], -1, 1)), np.arctan2(n[..., 1], n[..., 0])
    return {(l, m): sph_harm_y(l, m, theta, phi) for l in range(order + 1) for m in range(-l, l + 1)}


# Quadrature over the sphere, exact far beyond order 8 for smooth functions.
nodes, node_weights = np.polynomial.legendre.leggauss(400)
phis = np.arange(800) * 2 * np.pi / 800
grid_z, grid_phi = np.meshgrid(nodes, phis, indexing="ij")
grid_r = np.sqrt(1 - grid_z**2)
SPHERE = np.stack([grid_r * np.cos(grid_phi), grid_r * np.sin(grid_phi), grid_z], -1)
WEIGHTS = np.repeat(node_weights[:, None], 800, 1) * 2 * np.pi / 800
BASIS = harmonics(ORDER, SPHERE)


def sums(function, at, factors):
    """Sum over l and m of factors[l] c_lm Y_lm(at)."""
    own = harmonics(len(factors) - 1, at)
    total = 0.0
    for (l, m), y in own.items():
        c = (function * np.conj(BASIS[l, m]) * WEIGHTS).sum()
        total += (factors[l] * c * y).real
    return float(total)


def zonal_of_lobe(kappa):
    """Means of P_l over a von Mises-Fisher lobe, l = 0, 1, 2."""
    a = 1 / np.tanh(kappa) - 1 / kappa
    return [1.0, a, 1 - 3 * a / kappa]


COSINE = [np.pi, 2 * np.pi / 3, np.pi / 4]
EXPONENT = 20
u, weights_u = np.polynomial.legendre.leggauss(200)
u, weights_u = (u + 1) / 2, weights_u / 2
BLINN = [float((2 * np.pi * (EXPONENT + 1) / (2 * np.pi) * u**EXPONENT * eval_legendre(l, u) * weights_u).sum())
         for l in range(ORDER + 1)]

SKY = radiance(SPHERE)


def over_halves(wo):
    cosine = SPHERE @ wo
    return radiance(2 * cosine[..., None] * SPHERE - wo) * 4 * np.maximum(cosine, 0)


# Views that the program has tables for, 22.5 degrees around the vertical (y) and 12 from it: there its sum is
# exact, and elsewhere interpolated.
views = []
for i, j in [(6, 5), (7, 3), (8, 7), (8, 10), (9, 6), (10, 9)]:
    phi, theta = 2 * np.pi * i / 16, np.pi * j / 15
    views.append([np.sin(theta) * np.sin(phi), np.cos(theta), -np.sin(theta) * np.cos(phi)])
views = np.array(views)
OVER_HALVES = [over_halves(wo) for wo in [*eyes, *views]]

mixtures = []
for _ in range(TEXELS):
    weights = rng.dirichlet([2, 2, 2])
    mus = normalised(np.stack([rng.uniform(-0.5, 0.5, 3), rng.uniform(-0.5, 0.5, 3), np.ones(3)], -1))
    kappas = 10 ** rng.uniform(0.7, 2.5, 3)
    channels = []
    for a, mu, k in zip(weights, mus, kappas):
        # kappa = (3 r - r^3) / (1 - r^2), the program's and Banerjee et al.'s; r by bisection.
        low, high = 0.0, 1.0
        for _ in range(200):
            r = (low + high) / 2
            low, high = (r, high) if (3 * r - r**3) / (1 - r * r) < k else (low, r)
        channels.append([a, a * r * mu[0], a * r * mu[1], a * (1 - r * mu[2])])
    channels = float32(channels)
    irradiance, printed = 0.0, np.zeros(PATHS + len(views))
    for a, x, y, missing in channels:
        mean = np.array([x, y, a - missing]) / a
        r = np.linalg.norm(mean)
        mu, k = mean / r, (3 * r - r**3) / (1 - r * r)
        irradiance += a * sums(SKY, mu, [c * f for c, f in zip(COSINE, zonal_of_lobe(k))])
        for i, over in enumerate(OVER_HALVES):
            factors = [f * np.exp(-l * l / (2 * k)) for l, f in enumerate(BLINN)]
            printed[i] += a * sums(over, mu, factors)
    mixtures.append({"channels": channels.flatten().tolist(), "irradiance": irradiance / np.pi,
                     "equation_26": printed[:PATHS].tolist(), "equation_26_at_views": printed[PATHS:].tolist()})

# Perceptual roughnesses of the levels of a cube that has six.
blurs = []
for name in ["beckmann", "ggx"]:
    for level in range(1, 6):
        roughness = level / 5
        a2 = roughness**4
        # Over log(1 - u), as peaks are narrow; u is the cosine of the mirror direction.
        t, dt = np.polynomial.legendre.leggauss(4000)
        log_fall = (t - 1) / 2 * 40
        fall = np.exp(log_fall)
        u = 1 - fall
        tan2 = fall / (2 - fall)
        cos4 = ((2 - fall) / 2) ** 2
        shape = np.exp(-tan2 / a2) if name == "beckmann" else 1 / (a2 + tan2) ** 2
        measure = shape / cos4 * u * fall * dt
        factors = [float((eval_legendre(l, u) * measure).sum() / measure.sum()) for l in range(3)]
        blurs.append({"facets": name, "roughness": roughness,
                      "radiance": [sums(SKY, w, factors) for w in [*lights, *eyes]]})

json.dump({"lights": lights.tolist(), "eyes": eyes.tolist(), "views": views.tolist(), "slopes": slopes, "mixtures": mixtures,
           "blurs": blurs}, __import__("sys").stdout)
print()
