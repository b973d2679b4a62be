#!/usr/bin/env python3
"""Mitsuba 3 as an independent witness: references for tests/rendering/mitsuba.rs and scattering.rs, and a comparison
by hand.

Needs `pip install mitsuba` (3.9.1; variant scalar_rgb, as LLVM 14 and 15 do not compile the kernels of llvm_ad_rgb).
`cargo test` needs none of this: it reads the references that are stored beside the scenes.

    compare.py reference [NAME...] [--samples N]   renders NAME.xml to NAME.exr (all scenes without a name)
    compare.py reference veach-door --samples 131072   the same for a scene of others, see OTHERS below
    compare.py scattering                          evaluates the bsdfs of scattering.xml into scattering.csv
    compare.py check [NAME...] [--relt PROGRAM]    renders with relt, prints how far it is from the references

A reference holds R, G, B: the mean of PASSES independent passes of Mitsuba's `path`, and variance.R, .G, .B: the
variance of that mean. Two things are special.

Where a mesh with shading normals emits, Mitsuba's next-event estimation takes the cosine at the light from the shading
normal although it samples by true area, and so gives another image than its own hits on the light do. In
smooth-emitter-light Mitsuba therefore samples the surface alone.

In scalar variants Mitsuba's films take filters from a table of 31 steps, which shifts edges by up to 3 % of a pixel's
value. Scenes in FILTERS are therefore rendered with FINE² boxes a pixel, to which the filter's own function is applied
here.

scattering.csv has PAIRS pairs of directions for each shape's bsdf, most of them sampled by it, with what `eval` (value
times cosine, of radiance) and `pdf` say; `wo` leads to the eye and `wi` to the light, as in relt and not as in Mitsuba.
"""

import argparse
import os
import pathlib
import re
import subprocess
import tempfile
import xml.etree.ElementTree

import mitsuba as mi
import numpy as np

HERE = pathlib.Path(__file__).parent
PASSES = 16
FINE = 16
PAIRS = 20
FILTERS = {
    "gaussian": {"type": "gaussian", "stddev": 0.8},
    "tent": {"type": "tent", "radius": 1.5},
    "everything": {"type": "gaussian"},
    "crop": {"type": "gaussian", "stddev": 0.8},
    "mitchell": {"type": "mitchell", "B": 0.2, "C": 0.6},
    "catmullrom": {"type": "catmullrom"},
    "lanczos": {"type": "lanczos"},
}
PIXELS = r'(name="(?:crop_)?(?:width|height|offset_[xy])" value=)"(\d+)"'
# Scenes of others are no part of the repository; their references are of 32 × 18 pixels.
OTHERS = pathlib.Path(os.environ.get("RELT_SCENES", HERE.parents[2] / "shared/scenes"))
SURFACE_ONLY = {"type": "direct", "emitter_samples": 0, "bsdf_samples": 1}


def reference(name, samples):
    own = HERE / f"{name}.xml"
    text = own.read_text() if own.exists() else None
    kernel = FILTERS.get(name)
    if kernel:
        text = re.sub(PIXELS, lambda found: f'{found[1]}"{int(found[2]) * FINE}"', text)
        text = re.sub(r'<rfilter type="\w+"(/>|>.*</rfilter>)', '<rfilter type="box"/>', text)
        samples //= FINE * FINE
    mi.file_resolver().append(str(HERE))
    scene = mi.load_string(text) if text else mi.load_file(str(OTHERS / name / "scene.xml"), resx=32, resy=18)
    integrator = mi.load_dict(SURFACE_ONLY) if name == "smooth-emitter-light" else scene.integrator()
    passes = []
    for seed in range(PASSES):
        image = np.array(mi.render(scene, integrator=integrator, spp=samples // PASSES, seed=seed), dtype=np.float64)
        passes.append(filtered(image[..., :3], kernel) if kernel else image[..., :3])
    passes = np.array(passes)
    mean, variance = passes.mean(0), passes.var(0, ddof=1) / PASSES
    channels = ["R", "G", "B", "variance.R", "variance.G", "variance.B"]
    planes = np.concatenate([mean, variance], axis=2).astype(np.float32)
    mi.Bitmap(planes, mi.Bitmap.PixelFormat.MultiChannel, channels).write(str(HERE / f"{name}.exr"))
    error = np.sqrt(variance.mean())
    print(f"{name:22} mean {mean.mean((0, 1)).round(5)}, RMSE of a channel {error:.1e}", flush=True)


def scattering():
    draw = np.random.default_rng(1).random
    lines = ["shape,wo.x,wo.y,wo.z,wi.x,wi.y,wi.z,R,G,B,pdf"]
    for shape in xml.etree.ElementTree.parse(HERE / "scattering.xml").getroot().iter("shape"):
        element = shape.find("bsdf")
        element.set("version", "3.0.0")
        bsdf, context = mi.load_string(xml.etree.ElementTree.tostring(element, encoding="unicode")), mi.BSDFContext()
        one_sided = not mi.has_flag(bsdf.flags(), mi.BSDFFlags.Transmission)
        si = mi.SurfaceInteraction3f()
        for pair in range(PAIRS):
            wo = mi.warp.square_to_uniform_sphere(list(draw(2)))
            si.wi = mi.Vector3f(wo.x, wo.y, abs(wo.z)) if one_sided else mi.Vector3f(wo)
            wi = mi.warp.square_to_uniform_sphere(list(draw(2)))
            if pair % 4:
                sample = bsdf.sample(context, si, draw(), list(draw(2)))[0]
                delta = mi.has_flag(sample.sampled_type, mi.BSDFFlags.Delta)
                wi = wi if sample.pdf == 0 or delta else sample.wo
            value, pdf = bsdf.eval(context, si, wi), bsdf.pdf(context, si, wi)
            numbers = [*si.wi, *wi, *value, pdf]
            lines.append(",".join([shape.get("id"), *(f"{number:.8g}" for number in numbers)]))
    (HERE / "scattering.csv").write_text("\n".join(lines) + "\n")


def filtered(image, kernel):
    """The picture that a filter makes of one with FINE² boxes a pixel: h as Mitsuba evaluates it, normalised over the
    film."""
    h = mi.load_dict(kernel)

    def weights(fine):
        w = np.array([[h.eval((i + 0.5) / FINE - (j + 0.5)) for i in range(fine)] for j in range(fine // FINE)])
        return w / w.sum(1, keepdims=True)

    return np.einsum("ji,lk,ikc->jlc", weights(image.shape[0]), weights(image.shape[1]), image)


def read(path):
    bitmap = mi.Bitmap(str(path))
    names = [field.name for field in bitmap.struct_()]
    planes = np.array(bitmap, dtype=np.float64)
    pick = lambda prefix: planes[..., [names.index(prefix + c) for c in "RGB"]]
    return pick(""), pick("variance.") if "variance.R" in names else None


def check(name, relt, runs=8, mpp=1024):
    expected, variance = read(HERE / f"{name}.exr")
    images = []
    with tempfile.TemporaryDirectory() as folder:
        for seed in range(runs):
            out = pathlib.Path(folder) / "out.exr"
            options = ["--method", "path", "--mpp", str(mpp), "--seed", str(seed), "--quiet", "-o", str(out)]
            subprocess.run([relt, "render", str(HERE / f"{name}.xml"), *options], check=True)
            images.append(read(out)[0])
    images = np.array(images)
    mean, own = images.mean(0), images.var(0, ddof=1) / runs
    total = images.mean((1, 2))
    t = (total.mean(0) - expected.mean((0, 1))) / np.sqrt(total.var(0, ddof=1) / runs + variance.mean((0, 1)) / expected[..., 0].size)
    z2 = (mean - expected) ** 2 / np.maximum(own + variance, 1e-14)
    ratio = mean.mean((0, 1)) / expected.mean((0, 1))
    print(f"{name:22} mean ratio {ratio.round(5)}, t {t.round(1)}, mean z² {z2.mean():.2f}, largest {z2.max():.0f}", flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=["reference", "scattering", "check"])
    parser.add_argument("names", nargs="*", default=sorted({path.stem for path in HERE.glob("*.xml")} - {"scattering"}))
    parser.add_argument("--samples", type=int, default=32768, help="samples a pixel of a reference")
    parser.add_argument("--relt", default="target/release/relt", help="the program to check")
    parser.add_argument("--variant", default="scalar_rgb")
    arguments = parser.parse_args()
    mi.set_variant(arguments.variant)
    if arguments.what == "scattering":
        return scattering()
    for name in arguments.names:
        if arguments.what == "reference":
            reference(name, arguments.samples)
        else:
            check(name, arguments.relt)


if __name__ == "__main__":
    main()
