#!/usr/bin/env python3
"""Mitsuba 3 as an independent witness: single values of scattering functions, for tests/rendering/probes.rs.

Needs `pip install mitsuba` (3.9.1, variant scalar_rgb). `cargo test` needs none of this: it reads what

    python3 tests/mitsuba/probes.py > tests/mitsuba/probes.json

wrote: for each of BSDFS its XML and rows of two directions in the local frame, towards the eye and towards the light,
the value times the cosine to the light (red, green, blue), and the density of sampling the second direction. Half of
the directions are anywhere on their side, half where facets of the material's roughness send light.
"""

import random

import mitsuba as mi
import numpy as np

COLOUR = "0.7, 0.4, 0.1"


def principled(alpha, index=None, color=COLOUR, **parameters):
    """XML of a principled material; the slope of its facets, roughly; the index inside where light gets there."""
    inner = f'<rgb name="base_color" value="{color}"/>'
    inner += "".join(f'<float name="{name}" value="{value}"/>' for name, value in parameters.items())
    return f'<bsdf type="principled">{inner}</bsdf>', alpha, index


BSDFS = [
    principled(0.25),
    principled(0.04, roughness=0.2, specular=0.2),
    principled(0.5, roughness=1.0, specular=1.0),
    principled(0.25, flatness=1.0, roughness=0.8),
    principled(0.25, flatness=0.4, roughness=0.3, eta=2.0),
    principled(0.25, sheen=1.0),
    principled(0.25, sheen=0.6, sheen_tint=0.7, color="0.1, 0.3, 0.6"),
    principled(0.1, spec_tint=0.8, roughness=0.3),
    principled(0.1, metallic=1.0, roughness=0.3),
    principled(0.1, metallic=0.5, roughness=0.4, spec_tint=0.5),
    principled(0.2, anisotropic=0.9, metallic=1.0, roughness=0.4),
    principled(0.2, anisotropic=0.3, roughness=0.5),
    principled(0.1, clearcoat=1.0, roughness=0.7),
    principled(0.03, clearcoat=0.5, clearcoat_gloss=0.7, roughness=0.7),
    principled(0.25, 1.5, spec_trans=1.0),
    principled(0.1, 1.33, spec_trans=1.0, eta=1.33, roughness=0.3, color="1, 1, 1"),
    principled(0.25, 0.7, spec_trans=0.8, eta=0.7, clearcoat=0.4),
    principled(0.25, 2.0, spec_trans=0.6, eta=2.0, metallic=0.3, anisotropic=0.5, roughness=0.6, spec_tint=0.4,
               sheen=0.5, sheen_tint=0.5, flatness=0.5, clearcoat=0.7, clearcoat_gloss=0.2),
    principled(0.25, color="0, 0, 0", spec_tint=1.0, sheen=0.5, sheen_tint=1.0),
    principled(0.25, metallic=0.5, spec_tint=0.5, clearcoat=0.5, specular=0.0),
    principled(0.25, 1.0180, spec_trans=0.5, specular=0.0),
    principled(0.25, metallic=0.2, clearcoat=0.8, diffuse_reflectance_sampling_rate=0.3,
               main_specular_sampling_rate=2.0, clearcoat_sampling_rate=0.5),
]


def unit(v):
    v = np.asarray(v, dtype=np.float64)
    return v / np.linalg.norm(v)


def anywhere(side):
    cos, phi = random.uniform(0.02, 1.0), random.uniform(0, 2 * np.pi)
    sin = np.sqrt(1 - cos * cos)
    return np.array([sin * np.cos(phi), sin * np.sin(phi), side * cos])


def facet(alpha):
    tan, phi = alpha * np.sqrt(1 / random.uniform(0.1, 1.0) - 1), random.uniform(0, 2 * np.pi)
    return unit([tan * np.cos(phi), tan * np.sin(phi), 1.0])


def reflected(wo, m):
    return 2 * np.dot(wo, m) * m - wo


def refracted(wo, m, eta):
    m, eta = (m, eta) if wo[2] > 0 else (-m, 1 / eta)
    cos = np.dot(wo, m)
    cos2 = 1 - (1 - cos * cos) / eta**2
    return None if cos2 <= 0 else (cos / eta - np.sqrt(cos2)) * m - wo / eta


def directions(alpha, eta):
    for cos in [0.95, 0.5, 0.1]:
        for side in [1, -1] if eta else [1]:
            wo = unit(np.append(anywhere(side)[:2], 0)) * np.sqrt(1 - cos * cos) + np.array([0, 0, side * cos])
            others = [anywhere(side), anywhere(side), reflected(wo, facet(alpha)), reflected(wo, facet(alpha))]
            if eta:
                others += [anywhere(-side), refracted(wo, facet(alpha), eta), refracted(wo, facet(alpha), eta)]
            yield from ((wo, wi) for wi in others if wi is not None)


def rows(bsdf, alpha, eta):
    material, context = mi.load_string(bsdf.replace("<bsdf ", '<bsdf version="3.0.0" ', 1)), mi.BSDFContext()
    for wo, wi in directions(alpha, eta):
        wo, wi = (np.float32(unit(w)) for w in (wo, wi))
        point = mi.SurfaceInteraction3f()
        point.wi = mi.Vector3f(*map(float, wo))
        towards = mi.Vector3f(*map(float, wi))
        value, pdf = material.eval(context, point, towards), material.pdf(context, point, towards)
        yield ", ".join(str(np.float32(x)) for x in [*wo, *wi, *value, pdf])


def main():
    mi.set_variant("scalar_rgb")
    random.seed(5)
    entries = []
    for bsdf, alpha, eta in BSDFS:
        table = ",\n      ".join(f"[{row}]" for row in rows(bsdf, alpha, eta))
        text = bsdf.replace('"', "'")
        entries.append(f'  {{\n    "bsdf": "{text}",\n    "rows": [\n      {table}\n    ]\n  }}')
    print("[\n" + ",\n".join(entries) + "\n]")


if __name__ == "__main__":
    main()
