#!/usr/bin/env python3
"""Vector files for every named function: hard binary32 inputs, outputs exact on those inputs.

    make.py OUTDIR ROWS [--seed N] [--only NAME ...] [--check]

Outputs come from the definitions, evaluated plainly at a working precision that leaves at least 50 digits after
every cancellation; no form here is chosen for its behaviour in floating point. An empty cell is an output that the
definitions leave open. `--check` evaluates each row again with twice the digits and compares the printed text.
"""

import argparse
import csv
import math
import pathlib
import random
import sys

import mpmath
import numpy as np
from mpmath import mp, mpc, mpf

DIGITS = 120  # the worst loss is below 70: 1 - exp(-1e-30), sin^2 of a 1e-30 rotation
TABLES = pathlib.Path(__file__).resolve().parents[4] / "assets" / "cmf"
MIN_NORMAL = 2.0**-126
MAX = float(np.finfo(np.float32).max)


# ------------------------------------------------------------------------------------------------- definitions

def zero_if_noise(x):
    """Rounding residue of an exact zero. No nonzero value that comes here is below 1e-77."""
    return mpf(0) if abs(x) < mpf(10) ** (-DIGITS * 3 // 4) else x


def dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cosine(a, b):
    """Of the angle between two directions of any length; exactly 1 for equal ones."""
    return zero_if_noise(dot(a, b) / mp.sqrt(dot(a, a) * dot(b, b)))


def unit(a):
    length = mp.sqrt(dot(a, a))
    return [x / length for x in a]


def add(a, b):
    return [zero_if_noise(x + y) for x, y in zip(a, b)]


def plus(x):
    return max(x, mpf(0))


def fresnel_schlick(cos_in, n, kappa):
    f0 = ((n - 1) ** 2 + kappa**2) / ((n + 1) ** 2 + kappa**2)
    return f0, f0 + (1 - f0) * (1 - min(cos_in, mpf(1))) ** 5


def fresnel_dielectric(c, n):
    disc = 1 - (1 - c**2) / n**2
    if disc < 0:
        return 1, 1, 1, 0, 1
    ct = mp.sqrt(disc)
    if c == 0 and ct == 0:  # n = 1: rs and rp are 0/0, total reflection is a matter of taste
        return 1, None, None, 0, None
    rs = (c - n * ct) / (c + n * ct)
    rp = (n * c - ct) / (n * c + ct)
    return (rs**2 + rp**2) / 2, rs, rp, ct, 0


def fresnel_conductor(c, n, kappa):
    m = mpc(n, kappa)
    mt = mp.sqrt(m**2 - (1 - c**2))  # m cos(theta_t), the root with Re >= 0 and Im >= 0
    if c == 0 and mt == 0:
        return None, None, None
    power = lambda a, b: (a.real**2 + a.imag**2) / (b.real**2 + b.imag**2)
    rs = power(c - mt, c + mt)
    rp = power(m**2 * c - mt, m**2 * c + mt)
    return (rs + rp) / 2, rs, rp


def reflect(*a):
    v, n = unit(a[0:3]), unit(a[3:6])
    d = cosine(a[0:3], a[3:6])
    return [zero_if_noise(x - 2 * d * y) for x, y in zip(v, n)]


def refract(*a):
    v, normal, n = unit(a[0:3]), unit(a[3:6]), a[6]
    c = -cosine(a[0:3], a[3:6])
    disc = zero_if_noise(1 - (1 - c**2) / n**2)
    if disc < 0:
        return None, None, None, 1, disc
    if disc == 0:
        return None, None, None, None, disc
    return *(zero_if_noise(x / n + y * (c / n - mp.sqrt(disc))) for x, y in zip(v, normal)), 0, disc


def critical_angle(n_in, n_out):
    if n_in == n_out:
        return None, None, None, None
    if n_in < n_out:
        return 0, None, None, None
    theta = mp.asin(n_out / n_in)
    return 1, theta, mp.degrees(theta), mp.cos(theta)


def lambert(*a):
    cos_plus = plus(cosine(a[0:3], a[3:6]))
    return cos_plus, a[6] * a[7] * cos_plus


def half_vector(normal, l, v):
    """cos and sin^2 of the angle between N and L/|L| + V/|V|; nothing for L = -V."""
    s = add(unit(l), unit(v))
    if s == [0, 0, 0]:
        return None, None
    c = cosine(normal, s)
    return c, zero_if_noise(1 - c**2)


def blinn_phong(*a):
    normal, l, v, (lin, kd, ks, shine) = a[0:3], a[3:6], a[6:9], a[9:13]
    cos_in = cosine(normal, l)
    cos_delta, sin2_delta = half_vector(normal, l, v)
    if cos_in < 0:
        return cos_in, cos_delta, sin2_delta, None, 0
    spec = plus(cos_delta) ** shine if cos_delta is not None else mpf(0)
    return cos_in, cos_delta, sin2_delta, spec, lin * kd * cos_in + lin * ks * spec


def reciprocal_phong(*a):
    normal, l, v, (lin, kd, ks, shine) = a[0:3], a[3:6], a[6:9], a[9:13]
    cos_in = cosine(normal, l)
    s = add(unit(l), unit(v))
    lv2 = dot(s, s)
    if cos_in < 0:
        return lv2, None, 0
    cos_delta, _ = half_vector(normal, l, v)
    fr_spec = ks * plus(cos_delta) ** shine / lv2 if cos_delta is not None else mpf(0)
    return lv2, fr_spec, lin * (kd + fr_spec) * cos_in


def distribution(c, alpha):
    return alpha**2 / (mp.pi * (c**2 * alpha**2 + (1 - c**2)) ** 2)


def smith_lambda(c, alpha):
    return (mp.sqrt(1 + alpha**2 * (1 - c**2) / c**2) - 1) / 2


def ggx_d(*a):
    c = cosine(a[0:3], a[3:6])
    return c, zero_if_noise(1 - c**2), distribution(c, a[6]) if c > mpf("2e-7") else None


def ggx_g(nol, nov, alpha):
    g1 = [1 / (1 + smith_lambda(c, alpha)) if c > 0 else mpf(0) for c in (nol, nov)]
    if nol == 0 or nov == 0:
        return *g1, 0, None
    g2 = 1 / (1 + smith_lambda(nol, alpha) + smith_lambda(nov, alpha))
    return *g1, g2, g2 / (4 * nol * nov)


def ggx_f(f0, voh):
    return (f0 + (1 - f0) * (1 - min(voh, mpf(1))) ** 5,)


def ggx(*a):
    normal, l, v, (alpha, f0) = a[0:3], a[3:6], a[6:9], a[9:11]
    nol, nov = cosine(normal, l), cosine(normal, v)
    d = distribution(half_vector(normal, l, v)[0], alpha)
    g2 = ggx_g(nol, nov, alpha)[2]
    f = ggx_f(f0, zero_if_noise(cosine(v, add(unit(l), unit(v)))))[0]
    fr = d * g2 * f / (4 * nol * nov)
    return d, g2, f, fr, fr * nol


def beer_lambert(l0, sigma, d):
    tau = sigma * d
    t = mp.exp(-tau)
    return tau if tau <= MAX else None, t, 1 - t, l0 * t


def beer_lambert_sum(n, s0, ds, seed):
    i = np.arange(int(n), dtype=np.uint64)  # i * 2654435761 + seed < 2^63 for n <= 1e9
    m = ((i * np.uint64(2654435761) + np.uint64(int(seed))) % np.uint64(2**32)) >> np.uint64(9)
    tau = ds * s0 * (n + mpf(int(m.sum())) / 2**23)
    return tau, mp.exp(-tau), 1 - mp.exp(-tau)


def light_directional(*a):
    if not any(a[3:6]):
        return None, None
    cos_plus = plus(cosine(a[0:3], a[3:6]))
    return cos_plus, a[6] * cos_plus


def light_point(*a):
    l = [q - p for p, q in zip(a[0:3], a[3:6])]
    r2 = dot(l, l)
    if r2 == 0:
        return 0, None, None, None
    cos_plus = plus(cosine(a[6:9], l))
    return r2, cos_plus, a[9] / r2, a[9] / r2 * cos_plus


def srgb(x):
    low, high = mpf("0.0031308"), mpf("0.04045")
    a, gamma = mpf("0.055"), mpf("2.4")
    encode = x * mpf("12.92") if x <= low else (1 + a) * x ** (1 / gamma) - a
    decode = x / mpf("12.92") if x <= high else ((x + a) / (1 + a)) ** gamma
    return encode, decode


def table(name):
    with open(TABLES / name, newline="") as file:
        rows = {int(r[0]): [float(np.float32(x)) for x in r[1:]] for r in list(csv.reader(file))[1:]}
    return [rows.get(nm, [0.0, 0.0, 0.0]) for nm in WAVELENGTHS]


WAVELENGTHS = range(380, 781, 5)
CIE1931 = table("cmf_cie1931_2deg_5nm.csv")
STILES_BURCH = table("cmf_stiles_burch1959_10deg_5nm.csv")
XYZ_TO_SRGB = [["3.2406", "-1.5372", "-0.4986"], ["-0.9689", "1.8758", "0.0415"], ["0.0557", "-0.2040", "1.0570"]]


def matched(spectrum, cmf):
    return [5 * sum((s * mpf(row[k]) for s, row in zip(spectrum, cmf)), mpf(0)) for k in range(3)]


def cmf_integral(*spectrum):
    xyz = matched(spectrum, CIE1931)
    return *xyz, *(dot([mpf(x) for x in row], xyz) for row in XYZ_TO_SRGB), *matched(spectrum, STILES_BURCH)


def gaussian(a, mu, width):
    return [a * mp.exp(-(((nm - mu) / width) ** 2) / 2) for nm in WAVELENGTHS]


def cmf_gaussian(a, mu, width):
    spectrum = gaussian(a, mu, width)
    return *matched(spectrum, CIE1931), *matched(spectrum, STILES_BURCH)


# ------------------------------------------------------------------------------------------------------ inputs

def f32(x):
    """Nearest binary32, no -0."""
    return float(np.float32(x)) + 0.0


def ulps(x, k):
    x = np.float32(x)
    for _ in range(abs(k)):
        x = np.nextafter(x, np.float32(math.copysign(np.inf, k)))
    return float(x) + 0.0


AXES = [(0, 0, 1), (0, 1, 0), (1, 0, 0), (0, 0, -1), (0, -1, 0), (-1, 0, 0)]
METALS = [(0.1635, 3.5543), (0.5828, 2.1542), (1.4022, 1.9248), (0.04, 2.5953), (0.2469, 3.565), (1.2432, 2.3679),
          (0.6137, 5.3874), (0.9147, 6.354), (1.5271, 7.663), (3.2, 3.3)]


class Draw(random.Random):
    def log(self, lo, hi):
        return math.exp(self.uniform(math.log(lo), math.log(hi)))

    def sign(self):
        return self.choice((-1.0, 1.0))

    def one_of(self, *weighted):
        """(weight, thunk) pairs."""
        return self.choices([t for _, t in weighted], [w for w, _ in weighted])[0]()

    def direction(self):
        while True:
            v = np.array([self.uniform(-1, 1) for _ in range(3)])
            if 0.01 < v @ v < 1:
                return v / math.sqrt(v @ v)

    def normal(self):
        """An axis, where a grazing cosine of 1e-8 exists in binary32, or any direction; rounded."""
        return vec(self.one_of((2, lambda: self.choice(AXES)), (3, self.direction)))

    def across(self, a):
        while True:
            p = np.cross(a, self.direction())
            if p @ p > 0.01:
                return p / math.sqrt(p @ p)

    def turned(self, a, angle):
        """The direction a, turned by the angle about a random axis."""
        a = np.array(a, float)
        a = a / math.sqrt(a @ a)
        return math.cos(angle) * a + math.sin(angle) * self.across(a)

    def at_cosine(self, a, c):
        a = np.array(a, float)
        a = a / math.sqrt(a @ a)
        return c * a + math.sqrt(max(0.0, (1 - c) * (1 + c))) * self.across(a)

    def cosine(self):
        """In [0, 1]: anything, grazing down to 1e-8, within 1e-15 of the normal, both ends."""
        return self.one_of((4, lambda: self.uniform(0, 1)), (4, lambda: self.log(1e-8, 1)),
                           (3, lambda: math.cos(self.log(1e-7, 1.5))), (0.5, lambda: 0.0), (0.5, lambda: 1.0))

    def index(self):
        return f32(self.one_of((3, lambda: self.uniform(1, 3)), (2, lambda: 1 / self.uniform(1, 3)),
                               (3, lambda: 1 + self.sign() * self.log(1e-7, 0.1)),
                               (2, lambda: self.log(0.05, 20)),
                               (1, lambda: self.choice([1.2, 1.333, 1.5, 2.42, 1 / 1.333, 1 / 1.5, 10, 0.1]))))

    def near_angle(self):
        return self.one_of((3, lambda: self.log(1e-7, math.pi)), (1, lambda: math.pi - self.log(1e-7, 1)),
                           (1, lambda: self.uniform(0, math.pi)))

    def alpha(self):
        return f32(self.one_of((4, lambda: self.log(1e-5, 1)), (1, lambda: self.uniform(0, 1) ** 2 or 1),
                               (0.3, lambda: self.choice([1e-5, 1.0]))))

    def radiance(self):
        return f32(self.one_of((5, lambda: self.log(1e-3, 1e6)), (2, lambda: self.choice([1, 4])), (0.2, lambda: 0)))

    def share(self):
        return f32(self.one_of((5, lambda: self.uniform(0, 1)), (1, lambda: self.choice([0.1, 0.5, 1])),
                               (0.5, lambda: 0)))


def vec(v):
    """A direction, normalised in binary64 and rounded; components that would be denormal are 0."""
    v = np.array(v, float)
    v = v / math.sqrt(v @ v)
    return tuple(0.0 if abs(x) < MIN_NORMAL else f32(x) for x in v)


def critical_cosine(n):
    return math.sqrt((1 - n) * (1 + n))


def in_fresnel_schlick(r):
    yield from [(1, 1.2, 0), (0, 1.2, 0), (1, 1, 0), (0, 1, 0), (0.5, 1, 0), (1, 1.5, 1e9), (0, 1.5, 1e9)]
    for n, k in [(1.5, 0), (1, 0), (1.0000001, 0), (0.5828, 2.1542)]:
        for d in (-2, -1, 1, 2):  # above 1: a dot product of rounded unit vectors
            yield ulps(1, d), n, k
    while True:
        n = r.index()
        k = r.one_of((3, lambda: 0.0), (3, lambda: r.log(1e-9, 1)), (3, lambda: r.log(1, 1e9)),
                     (1, lambda: r.log(0.1, 8)))
        if r.random() < 0.15:
            n, k = r.choice(METALS)
        yield r.cosine(), n, k


def in_fresnel_dielectric(r):
    yield from [(1, 1.2), (1, 1), (0, 1), (0, 1.5), (0, f32(1 / 1.5)), (0.5, 1), (0, ulps(1, 1)), (0, ulps(1, -1)),
                (1, ulps(1, 1)), (1, ulps(1, -1)), (1e-8, 1), (1e-8, 1.5), (1e-8, f32(1 / 1.5)), (1e-4, ulps(1, -1)),
                (0.5, 10), (1, 10), (1, 0.1), (f32(critical_cosine(f32(0.1))), 0.1)]
    while True:
        pick = r.random()
        n = r.index()
        if pick < 0.45:
            yield r.cosine(), n
        elif pick < 0.8:
            n = f32(r.one_of((2, lambda: r.uniform(0.05, 0.9999)), (1, lambda: 1 - r.log(1e-7, 0.5)),
                             (1, lambda: 1 / r.choice([1.333, 1.5, 2.42, 10]))))
            c = f32(critical_cosine(n))
            yield r.one_of((2, lambda: ulps(c, r.randint(-4, 4))),
                           (3, lambda: min(1, c * (1 + r.sign() * r.log(1e-7, 0.1))))), n
        else:
            c = 1 / math.sqrt(1 + n * n)
            yield r.one_of((1, lambda: ulps(c, r.randint(-3, 3))),
                           (1, lambda: min(1, c * (1 + r.sign() * r.log(1e-7, 0.1))))), n


def in_fresnel_conductor(r):
    yield from [(1, 1.2, 0), (0, 1.5, 0), (0, 1, 0), (0, 1, 3), (1, 1, 1e-3), (1, 1.5, 1e9), (0.5, 1.5, 1e9),
                (1e-8, 1.5, 1e9), (0, 1.5, 1e9), (0.5, 1, 0), (1, 1, 0), (0.2, 0.5, 0), (0.9, 0.5, 0)]
    yield from [(c, *METALS[1]) for c in (0, 1e-8, 1e-4, 0.5, ulps(1, -1), 1)]
    while True:
        pick = r.random()
        n, c = r.index(), r.cosine()
        small = lambda: r.one_of((1, lambda: 0.0), (4, lambda: r.log(1e-12, 0.1)), (0.3, lambda: r.log(1e-30, 1e-12)))
        if pick < 0.25:
            yield c, *r.choice(METALS)
        elif pick < 0.35:
            yield c, r.log(0.05, 5), r.log(0.1, 8)
        elif pick < 0.55:
            yield c, n, r.log(10, 1e9)
        elif pick < 0.7:
            yield c, n, small()
        elif pick < 0.8:
            yield c, 1 + r.sign() * r.log(1e-7, 0.1), small()
        elif pick < 0.93:
            n = f32(r.one_of((1, lambda: r.uniform(0.05, 0.9999)), (1, lambda: 1 - r.log(1e-7, 0.5)),
                             (1, lambda: r.log(1e-3, 0.1))))
            c = f32(critical_cosine(n))
            yield r.one_of((1, lambda: ulps(c, r.randint(-4, 4))),
                           (2, lambda: min(1, c * (1 + r.sign() * r.log(1e-7, 0.1))))), n, small()
        else:
            yield ulps(1 / math.sqrt(1 + n * n), r.randint(-3, 3)), n, small()


def toward(r, normal, c):
    """v of incidence cosine c, rounded, not behind the surface."""
    v = vec(-r.at_cosine(normal, c))
    return tuple(-x + 0.0 for x in v) if sum(x * y for x, y in zip(v, normal)) > 0 else v


def in_reflect(r):
    s = f32(math.sqrt(0.5))
    yield from [(0, 0, -1, 0, 0, 1), (s, 0, -s, 0, 0, 1), (1, 0, 0, 0, 0, 1), (1, 0, 0, -s, 0, s), (0, 0, 1, 0, 0, 1)]
    while True:
        normal = r.normal()
        yield *r.one_of((4, lambda: toward(r, normal, r.cosine())), (1, lambda: vec(r.turned(normal, r.near_angle()))),
                        (1, lambda: tuple(-x + 0.0 for x in normal)), (2, lambda: vec(r.direction()))), *normal


def in_refract(r):
    s = f32(math.sqrt(0.5))
    yield from [(0, 0, -1, 0, 0, 1, 1.5), (0, 0, -1, 0, 0, 1, 1), (s, 0, -s, 0, 0, 1, 1), (s, 0, -s, 0, 0, 1, s),
                (1, 0, 0, 0, 0, 1, 1.5), (1, 0, 0, 0, 0, 1, 0.5), (1, 0, 0, 0, 0, 1, 1), (0.6, 0, -0.8, 0, 0, 1, 0.6),
                (0.6, 0, -0.8, 0, 0, 1, ulps(0.6, 1)), (0.6, 0, -0.8, 0, 0, 1, ulps(0.6, -1))]
    yield from [(-x, -y, -z, x, y, z, f32(1 / 1.333)) for x, y, z in [vec((1, 2, 3)), vec((-3, 1, 1e-4))]]
    while True:
        normal, pick = r.normal(), r.random()
        if pick < 0.45:
            yield *toward(r, normal, r.cosine()), *normal, r.index()
        elif pick < 0.55:
            yield *toward(r, normal, math.cos(r.log(1e-7, 0.1))), *normal, r.index()
        else:
            n = f32(r.one_of((2, lambda: r.uniform(0.05, 0.9999)), (1, lambda: 1 - r.log(1e-7, 0.5)),
                             (1, lambda: 1 / r.choice([1.333, 1.5, 2.42, 10]))))
            c = critical_cosine(n)
            c = r.one_of((2, lambda: ulps(c, r.randint(-4, 4))),
                         (4, lambda: min(1, c * (1 + r.log(1e-6, 0.1)))),
                         (2, lambda: c * (1 - r.log(1e-6, 0.1))))
            yield *toward(r, normal, c), *normal, n


def in_critical_angle(r):
    yield from [(10, 1), (1, 10), (1, 1), (1.333, 1), (1.5, 1), (2.42, 1), (1, 1.5), (2, 1), (1.5, 1.333),
                (ulps(1, 1), 1), (1, ulps(1, 1)), (ulps(1.5, 1), 1.5), (1.5, ulps(1.5, 1)), (2, ulps(2, -1)),
                (1000, 1), (1, 1e-8), (1e4, 1e-4)]
    while True:
        yield r.one_of((3, lambda: (r.uniform(1, 4), r.uniform(1, 4))), (1, lambda: (r.uniform(1, 4), 1)),
                       (3, lambda: (lambda n: (f32(n * (1 + r.sign() * r.log(1e-7, 0.1))), f32(n)))(r.uniform(1, 4))),
                       (1, lambda: (1, 1 - r.log(1e-7, 0.5))), (2, lambda: (r.log(0.01, 1e3), r.log(0.01, 1e3))))


def any_side(r, normal):
    """A direction, mostly above the surface."""
    c = r.cosine()
    return vec(r.at_cosine(normal, -c if r.random() < 0.12 else c))


def in_lambert(r):
    z = (0, 0, 1)
    yield from [(*z, 0, 0.6, 0.8, 4, 0.1), (*z, *z, 1, 1), (*z, 0, 0, -1, 1, 1), (*z, 1, 0, 0, 1, 1),
                (*z, 1, 0, 1e-8, 1, 1), (*z, 1, 0, -1e-8, 1, 1), (*z, *z, 4, f32(1 / math.pi)), (*z, *z, 0, 0)]
    while True:
        normal = r.normal()
        l = r.one_of((6, lambda: any_side(r, normal)), (1, lambda: vec(r.turned(normal, r.near_angle()))),
                     (0.3, lambda: normal), (1, lambda: vec(r.direction())))
        yield *normal, *l, r.radiance(), r.share()


def lobe(r):
    """shine, and delta where the lobe is above 1e-6."""
    shine = f32(r.one_of((5, lambda: r.log(1, 1e7)), (1, lambda: r.choice([1, 3, 10, 1000, 1e6, 1e7]))))
    ln_f = -r.one_of((3, lambda: r.uniform(0, 13.8)), (2, lambda: r.log(1e-6, 13.8)))
    return shine, math.acos(math.exp(ln_f / shine))


def in_phong(r):
    z, s2 = (0, 0, 1), f32(math.sqrt(2))
    yield from [(*z, 0, 0.6, 0.8, 0, 0.8, 0.6, 4, 0, s2, 3), (*z, 0, 0.6, 0.8, *vec((1, 2, 3)), 4, 0.1, 0, 1),
                (*z, *z, *z, 1, 0.5, 0.5, 1e7), (*z, 1, 0, 0, *z, 1, 0.5, 0.5, 3), (*z, 1, 0, 0, 0, 0, -1, 1, 0.5, 0.5, 3),
                (*z, 0, 0, -1, *z, 1, 0.5, 0.5, 3), (*z, *z, 0, 0, -1, 1, 0.5, 0.5, 3), (*z, 1, 0, 0, -1, 0, 0, 1, 0.5, 0.5, 3),
                (*z, 0, 0.6, 0.8, 0, -0.6, -0.8, 4, 0.1, 1, 3), (*z, 0, 0.6, 0.8, 0, -0.6, 0.8, 4, 0.1, 1, 1e7),
                (*z, 1, 0, 1e-8, -1, 0, 1e-8, 1, 0.1, 1, 1e4), (*z, 1, 0, 1e-4, -1, 0, 0, 1, 0.1, 1, 1),
                (*z, 0, 0.6, 0.8, 0, 0.6, -0.8, 4, 0.1, 1, 1), (*z, 0, 0.6, 0.8, 0, 0.8, -0.6, 4, 0.1, 1, 2)]
    while True:
        pick = r.random()
        shine, delta = lobe(r)
        rest = r.radiance(), r.share(), r.share(), shine
        if pick < 0.55:  # L anywhere, V by an angle away from L, N inside the lobe around H
            l = vec(r.direction())
            v = vec(r.turned(l, r.one_of((3, r.near_angle), (2, lambda: r.uniform(0, 2)))))
        elif pick < 0.8:  # L near -V
            l = vec(r.direction() if r.random() < 0.7 else r.choice(AXES))
            v = vec(-r.turned(l, r.log(1e-7, 1)))
        elif pick < 0.9:  # both grazing
            normal = vec(r.choice(AXES))
            l = vec(r.at_cosine(normal, r.log(1e-8, 1)))
            v = vec(r.at_cosine(normal, r.sign() * r.log(1e-8, 1)))
            yield *normal, *l, *v, *rest[:3], f32(r.log(1, 30))
            continue
        else:
            normal = r.normal()
            yield *normal, *any_side(r, normal), *any_side(r, normal), *rest[:3], f32(r.log(1, 30))
            continue
        s = np.array(l) / math.hypot(*l) + np.array(v) / math.hypot(*v)
        if s @ s == 0:
            continue
        yield *vec(r.turned(s, delta)), *l, *v, *rest


def keep_phong(x):
    """No lobe between 0 and 1e-6."""
    with mpmath.workdps(20):
        c = half_vector([mpf(t) for t in x[0:3]], [mpf(t) for t in x[3:6]], [mpf(t) for t in x[6:9]])[0]
        return c is None or c <= 0 or c ** mpf(x[12]) > 1e-6


def peak_angle(r, alpha):
    """An angle of H about N that matters for this alpha."""
    return r.one_of((3, lambda: math.atan(alpha * r.log(1e-3, 1e3))), (2, lambda: r.log(1e-7, 1.5)),
                    (1, lambda: r.uniform(0, 1.5)), (0.3, lambda: 0.0))


def in_ggx_d(r):
    z = (0, 0, 1)
    yield from [(*z, *z, a) for a in (1e-5, 1e-3, 0.1, 1)]
    yield from [(*z, *vec((t, 0, 1)), a) for t, a in [(1e-7, 1e-5), (1e-5, 1e-5), (1e-18, 1e-5), (1e-3, 1e-3), (1, 1)]]
    yield from [(*z, 1, 0, 0, 0.5), (*z, 1, 0, f32(3e-7), 1e-5), (*z, 1, 0, f32(1e-4), 0.5), (*z, 0, 0, -1, 0.5)]
    n = vec((1, 2, 3))
    yield *n, *n, 1e-5
    while True:
        normal, alpha = r.normal(), r.alpha()
        yield *normal, *vec(r.turned(normal, peak_angle(r, alpha))), alpha


def in_ggx_g(r):
    yield from [(1, 1, 0.5), (0, 1, 0.5), (1, 0, 0.5), (0, 0, 0.5), (1e-8, 1e-8, 1e-5), (1e-8, 1e-8, 1), (1, 1, 1),
                (1, 1, 1e-5), (1e-30, 1e-30, 0.1), (1e-30, 1, 1e-5), (0.5, 0.5, 1), (ulps(1, -1), ulps(1, -1), 0.01)]
    while True:
        tiny = lambda: r.log(1e-30, 1e-8) if r.random() < 0.08 else r.cosine()
        alpha = r.alpha()
        nol = tiny()
        nov = r.one_of((6, tiny), (1, lambda: nol), (1, lambda: min(1, alpha * r.log(0.01, 100))))
        yield nol, nov, alpha


def in_ggx_f(r):
    yield from [(f0, c) for f0 in (0, 0.04, 1) for c in (0, 0.5, ulps(1, -1), 1, ulps(1, 1), ulps(1, 2))]
    while True:
        yield r.one_of((3, lambda: r.uniform(0, 1)), (1, lambda: 0.04), (2, lambda: r.log(1e-8, 1)),
                       (1, lambda: 1 - r.log(1e-7, 0.1))), r.cosine()


def in_ggx(r):
    z = (0, 0, 1)
    yield from [(*z, *z, *z, a, 0.04) for a in (1e-5, 0.1, 1)]
    yield from [(*z, 0, 0.6, 0.8, 0, -0.6, 0.8, 1e-5, 1), (*z, 1, 0, 1e-8, -1, 0, 1e-8, 0.1, 0.04),
                (*z, 1, 0, 1e-8, -1, 0, 1e-8, 1e-5, 0.04), (*z, 1, 0, 1e-8, *z, 0.5, 0.5), (*z, *z, 1, 0, 1e-8, 0.5, 0.5),
                (*z, 1, 0, 1e-8, 0, 1, 1e-8, 1, 0), (*z, 0, 0.6, 0.8, 0, 0.6, 0.8, 0.5, 1)]
    while True:
        alpha, pick = r.alpha(), r.random()
        f0 = r.one_of((3, lambda: r.uniform(0, 1)), (2, lambda: 0.04), (1, lambda: r.log(1e-4, 1)), (0.5, lambda: 1.0))
        if pick < 0.55:
            l = vec(r.direction())
            v = vec(r.one_of((3, lambda: r.turned(l, r.uniform(0, 2.5))), (1, lambda: r.turned(l, r.near_angle())),
                             (1, lambda: -r.turned(l, r.log(1e-7, 1)))))
            s = np.array(l) / math.hypot(*l) + np.array(v) / math.hypot(*v)
            if s @ s == 0:
                continue
            normal = vec(r.turned(s, peak_angle(r, alpha)))
        else:
            normal = vec(r.choice(AXES)) if pick < 0.8 else r.normal()
            l, v = (vec(r.at_cosine(normal, r.cosine())) for _ in range(2))
        yield *normal, *l, *v, alpha, f0


def keep_ggx(x):
    a = [mpf(t) for t in x[:9]]
    n, l, v = a[0:3], a[3:6], a[6:9]
    if cosine(n, l) <= 0 or cosine(n, v) <= 0:
        return False
    c, _ = half_vector(n, l, v)
    return c is not None and c > 2e-7


def in_beer_lambert(r):
    yield from [(1, 0, MAX), (1, MAX, 0), (1, 0, 0), (0, 1, 1), (0, 1e30, 1e30), (1, 1e30, 1e30), (MAX, 1e30, 1e30),
                (1, 1, 1), (MAX, 0, 1), (1, 1, 1e-30), (1, 1e3, 1), (1, 1e15, 1e-15), (1, 0, 1e-30), (1e30, 1, 80)]
    yield from [(1, t, 1) for t in (87, 87.34, 88.7, 89, 103.9, 104, 200, 0.6931472)]
    while True:
        tau = r.one_of((2, lambda: r.log(1e-30, 1e-6)), (4, lambda: r.log(1e-6, 1e3)), (4, lambda: r.uniform(0, 20)),
                       (1, lambda: r.uniform(80, 110)))
        d = r.one_of((3, lambda: r.log(1e-3, 1e3)), (1, lambda: r.log(1e-7, 1e7)), (1, lambda: min(1, tau) * r.log(1, 1e6)))
        l0 = r.one_of((5, lambda: r.log(1e-3, 1e6)), (2, lambda: 1.0), (0.5, lambda: r.log(1e-30, 1e38)))
        yield l0, tau / d, d


def in_beer_lambert_sum(r):
    def row(n, tau):
        s0 = 2.0 ** r.randint(-20, 10)
        return n, s0, tau / (n * 1.5 * s0), r.randrange(2**24)

    yield from [(1, 1, 1, 0), (1, 1, 0, 7), (1, 1, 1e-30, 1), (2, 0.5, 2, 2**24 - 1), (1000, 0.5, 0.01, 1)]
    yield row(10**5, 5)
    yield row(10**6, 5)
    count = 2
    while True:
        count += 1
        if count in (200, 400, 600):
            yield row(10**5, r.uniform(4, 6))
        if count in (500, 1000):
            yield row(10**6, r.uniform(4, 6))
        n = r.one_of((3, lambda: int(r.log(1, 1000))), (1, lambda: r.randint(1, 1000)))
        yield row(n, r.one_of((3, lambda: r.uniform(0.01, 20)), (2, lambda: r.log(1e-10, 80))))


def in_light_directional(r):
    z = (0, 0, 1)
    yield from [(*z, 0, 3, 4, 4), (*z, 0, 0, 1e-22, 1), (*z, 0, 0, 1e18, 1), (*z, 1e18, 0, 0, 1), (*z, 1e-22, 0, 0, 1),
                (*z, 0, 0, -1e18, 1), (*z, 0, 0, 0, 1), (*z, 3e-22, 0, 4e-22, 10), (*z, 3e17, 0, 4e17, 10),
                (*z, 1e18, 0, 1e10, 1), (*z, 1e18, 0, -1e10, 1), (*z, 1e-22, 1e-22, 1e-30, 1), (*z, *z, 0)]
    while True:
        normal = r.normal()
        l = any_side(r, normal) if r.random() < 0.8 else vec(r.turned(normal, r.near_angle()))
        length = r.one_of((4, lambda: r.log(1e-22, 1e18)), (1, lambda: 1.0))
        yield *normal, *(x * length if abs(x * length) >= MIN_NORMAL else 0.0 for x in l), r.radiance()


def in_light_point(r):
    o, z = (0, 0, 0), (0, 0, 1)
    yield from [(*o, 0, 3, 4, *z, 25), (*o, 0, 0, 1, *z, 1), (*o, *o, *z, 1), (1e6, 1e6, 1e6, 1e6, 1e6, 1e6, *z, 1),
                (*o, 0, 0, 1e-18, *z, 1), (*o, 0, 0, 1e-18, *z, 1e6), (*o, 1e-18, 0, 0, *z, 1e6), (*o, 0, 0, 1e18, *z, 1),
                (*o, 0, 0, -1, *z, 1), (*o, 1, 0, 0, *z, 1), (1e6, 0, 0, 1e6, 0, 0.0625, *z, 1),
                (1e6, -1e6, 1e6, ulps(1e6, 1), -1e6, 1e6, 1, 0, 0, 1), (1, 1, 1, ulps(1, 1), 1, 1, 1, 0, 0, 1),
                (-1e18, 0, 0, 1e18, 0, 0, 1, 0, 0, 1e6), (*o, 0, 0, 2, *z, 0)]
    while True:
        normal, pick = r.normal(), r.random()
        l = np.array(any_side(r, normal))
        if pick < 0.35:  # anywhere in a scene
            p = np.array([r.uniform(-100, 100) for _ in range(3)])
            d = r.log(1e-3, 1e3)
        elif pick < 0.65:  # far from the world's origin
            p = np.array([r.sign() * 1e6 * r.uniform(0.5, 1.5) for _ in range(3)])
            d = r.log(0.06, 1e4)
        elif pick < 0.9:  # any distance, near the origin on its own scale
            d = r.log(1e-18, 1e18)
            p = d * r.log(1e-3, 1) * r.direction() if r.random() < 0.6 else np.zeros(3)
        else:
            d = r.log(1e-7, 1e3)
            p = np.array([r.uniform(-1, 1) for _ in range(3)])
        intensity = r.one_of((4, lambda: r.log(1e-3, 1e6)), (1, lambda: 1.0), (1, lambda: min(1e30, d * d)))
        small = lambda x: 0.0 if abs(x) < MIN_NORMAL else x
        yield *map(small, p), *map(small, p + d * l), *normal, intensity


def in_srgb(r):
    yield from [(0,), (1,), (0.5,), (ulps(1, -1),), (2.0**-126,), (ulps(2.0**-126, 1),), (1.2e-38,), (1e-37,), (1e-40,),
                (2.0**-149,), (1e-10,), (0.2140411,), (0.7353569,)]
    for t in (0.0031308, 0.04045, 0.0031308 * 12.92, 0.04045 / 12.92):
        yield from [(ulps(t, k),) for k in range(-3, 4)]
    while True:
        yield (r.one_of((4, lambda: r.uniform(0, 1)), (2, lambda: r.log(1e-37, 1)), (2, lambda: r.randint(0, 255) / 255),
                        (1, lambda: 0.0031308 * (1 + r.sign() * r.log(1e-7, 0.5))),
                        (1, lambda: 0.04045 * (1 + r.sign() * r.log(1e-7, 0.5))), (1, lambda: 1 - r.log(1e-7, 0.1))),)


def in_cmf_integral(r):
    count = len(WAVELENGTHS)
    spike = lambda *at: tuple(1.0 if nm in at else 0.0 for nm in WAVELENGTHS)
    yield (1.0,) * count
    yield (0.0,) * count
    for nm in (380, 385, 390, 445, 495, 500, 525, 555, 645, 780):
        yield spike(nm)
    yield spike(445, 525, 645)
    yield tuple((-1.0) ** i for i in range(count))
    yield tuple(i / (count - 1) for i in range(count))

    def planck(kelvin):
        return [1e-6 * nm**-5.0 * 1e17 / math.expm1(1.438777e7 / (nm * kelvin)) for nm in WAVELENGTHS]

    def bumps():
        out = np.zeros(count)
        for _ in range(r.randint(1, 5)):
            mu, w = r.uniform(370, 790), r.log(5, 100)
            out += r.uniform(0.1, 1) * np.exp(-(((np.array(WAVELENGTHS) - mu) / w) ** 2) / 2)
        return [x if x > 1e-12 else 0.0 for x in out]

    def lines():
        out = [0.0] * count
        for _ in range(r.randint(1, 6)):
            out[r.randrange(count)] = r.log(1e-2, 1e2)
        return out

    while True:
        scale = r.one_of((2, lambda: 1.0), (2, lambda: r.log(1e-6, 1e6)), (0.3, lambda: r.log(1e-20, 1e20)))
        spectrum = r.one_of((2, lambda: [r.uniform(0, 1) for _ in range(count)]), (2, bumps), (1, lines),
                            (1, lambda: planck(r.log(1500, 20000))),
                            (1, lambda: [r.uniform(-1, 1) for _ in range(count)]),
                            (1, lambda: [(-1) ** i * r.uniform(0.5, 1) for i in range(count)]),
                            (1, lambda: [r.log(1e-6, 1e6) for _ in range(count)]))
        yield tuple(scale * x for x in spectrum)


def in_cmf_gaussian(r):
    yield from [(1, 555, 20), (1, 500, 5), (1, 444.44, 1), (1, 526.32, 1), (1, 645.16, 1), (1, 380, 10), (1, 780, 10),
                (1, 300, 40), (1, 860, 40), (1, 580, 200), (1, 445, 1), (1, 447.5, 1), (0, 500, 10), (1, 389, 2)]
    while True:
        yield (r.one_of((2, lambda: 1.0), (3, lambda: r.log(1e-3, 1e5))),
               r.one_of((4, lambda: r.uniform(380, 780)), (1, lambda: r.uniform(300, 380)), (1, lambda: r.uniform(780, 900))),
               r.log(1, 200))


def keep_cmf_gaussian(x):
    """Some sample is worth adding."""
    with mpmath.workdps(20):
        return x[0] == 0 or max(gaussian(*(mpf(t) for t in x))) > 1e-20


# ------------------------------------------------------------------------------------------------------- files

NLV = "Nx Ny Nz Lx Ly Lz Vx Vy Vz"
SAMPLES = " ".join(f"s{nm}" for nm in WAVELENGTHS)

# Where nonzero outputs may lie, by magnitude.
NORMAL, ABOVE, ANY = (MIN_NORMAL, MAX), (MIN_NORMAL, math.inf), (0, math.inf)

# name: inputs, outputs, definition, input rows, filter of inputs, range of outputs
FUNCTIONS = {
    "fresnel_schlick": ("cos_in n kappa", "F0 F", fresnel_schlick, in_fresnel_schlick, None, NORMAL),
    "fresnel_dielectric": ("cos_in n", "F rs rp cos_t tir", fresnel_dielectric, in_fresnel_dielectric, None, NORMAL),
    "fresnel_conductor": ("cos_in n kappa", "F Rs Rp", fresnel_conductor, in_fresnel_conductor, None, NORMAL),
    "reflect": ("vx vy vz Nx Ny Nz", "Rx Ry Rz", reflect, in_reflect, None, NORMAL),
    "refract": ("vx vy vz Nx Ny Nz n", "Tx Ty Tz tir disc", refract, in_refract, None, NORMAL),
    "critical_angle": ("n_in n_out", "exists theta_rad theta_deg cos_theta", critical_angle, in_critical_angle, None, NORMAL),
    "lambert": ("Nx Ny Nz Lx Ly Lz Lin kd", "cos_plus Lref", lambert, in_lambert, None, NORMAL),
    "blinn_phong": (f"{NLV} Lin kd ks shine", "cos_in cos_delta sin2_delta spec Lref", blinn_phong, in_phong, keep_phong, NORMAL),
    "reciprocal_phong": (f"{NLV} Lin kd ks shine", "LV2 fr_spec Lref", reciprocal_phong, in_phong, keep_phong, NORMAL),
    "ggx_d": ("Nx Ny Nz Hx Hy Hz alpha", "cos_h sin2_h D", ggx_d, in_ggx_d, None, NORMAL),
    "ggx_g": ("NoL NoV alpha", "G1_L G1_V G2 Vis", ggx_g, in_ggx_g, None, NORMAL),
    "ggx_f": ("F0 VoH", "F", ggx_f, in_ggx_f, None, NORMAL),
    "ggx": (f"{NLV} alpha F0", "D G2 F fr fr_cos", ggx, in_ggx, keep_ggx, NORMAL),
    "beer_lambert": ("L0 sigma d", "tau T one_minus_T L", beer_lambert, in_beer_lambert, None, ANY),
    "beer_lambert_sum": ("n s0 ds seed", "tau T one_minus_T", beer_lambert_sum, in_beer_lambert_sum, None, NORMAL),
    "light_directional": ("Nx Ny Nz Lx Ly Lz E", "cos_plus irradiance", light_directional, in_light_directional, None, NORMAL),
    "light_point": ("Px Py Pz Qx Qy Qz Nx Ny Nz I", "r2 cos_plus E_perp irradiance", light_point, in_light_point, None, ABOVE),
    "srgb": ("x", "encode decode", srgb, in_srgb, None, ANY),
    "cmf_integral": (SAMPLES, "X Y Z sR sG sB r10 g10 b10", cmf_integral, in_cmf_integral, None, NORMAL),
    "cmf_gaussian": ("A mu_nm width_nm", "X Y Z r10 g10 b10", cmf_gaussian, in_cmf_gaussian, keep_cmf_gaussian, ANY),
}


def input_text(x):
    text = "%.9g" % x
    assert float(np.float32(text)) == x, text
    return text


def output_text(x):
    if x is None:
        return ""
    x = mpf(x)
    if abs(x) < mpf("1e-300"):
        return "0"
    text = mpmath.nstr(x, 20, strip_zeros=True)
    return text[:-2] if text.endswith(".0") else text


def rows(name, count, seed, check):
    _, _, definition, inputs, keep, (low, high) = FUNCTIONS[name]
    seen, out = set(), []
    for raw in inputs(Draw(f"{seed}:{name}")):
        if len(out) == count:
            return out
        x = tuple(f32(t) for t in raw)
        if x in seen or not all(math.isfinite(t) for t in x):
            continue
        seen.add(x)
        if keep and not keep(x):
            continue
        y = definition(*map(mpf, x))
        if not all(t is None or t == 0 or low <= abs(t) <= high for t in y):
            continue
        text = [output_text(t) for t in y]
        if check:
            with mpmath.workdps(2 * DIGITS):
                again = [output_text(t) for t in definition(*map(mpf, x))]
            if again != text:
                sys.exit(f"{name}{x}: {text} becomes {again} with more digits")
        out.append([input_text(t) for t in x] + text)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("outdir", type=pathlib.Path)
    parser.add_argument("rows", type=int)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", nargs="+", choices=FUNCTIONS, default=list(FUNCTIONS), metavar="NAME")
    parser.add_argument("--check", action="store_true")
    args = parser.parse_args()
    mp.dps = DIGITS
    args.outdir.mkdir(parents=True, exist_ok=True)
    for name in args.only:
        inputs, outputs = FUNCTIONS[name][:2]
        with open(args.outdir / f"{name}.csv", "w", newline="") as file:
            writer = csv.writer(file, lineterminator="\n")
            writer.writerow(inputs.split() + ["=" + o for o in outputs.split()])
            writer.writerows(rows(name, args.rows, args.seed, args.check))


if __name__ == "__main__":
    main()
