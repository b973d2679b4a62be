//! Pieces of scenes whose images are known by a formula, as XML.

/// A view of 12 × 8 pixels from `origin` towards `target`, where lengths are in units of `unit`; all paths up to
/// `max_depth` edges (−1: all), without roulette below 100 edges.
pub fn view(unit: f64, [origin, target]: [[f64; 3]; 2], fov: f64, max_depth: i32) -> String {
    let [from, to] = [origin, target].map(|p| point(p.map(|x| x * unit)));
    format!(
        "<integrator type='path'><integer name='max_depth' value='{max_depth}'/>
           <integer name='rr_depth' value='100'/></integrator>
         <sensor type='perspective'><float name='fov' value='{fov}'/>
           <float name='near_clip' value='{}'/><float name='far_clip' value='{}'/>
           <transform name='to_world'><lookat origin='{from}' target='{to}' up='0, 1, 0'/></transform>{}</sensor>",
        1e-3 * unit,
        1e3 * unit,
        film(12, 8),
    )
}

/// The same view without roulette.
pub fn without_roulette(view: &str) -> String {
    view.replace("name='rr_depth' value='100'", "name='rr_depth' value='16000'")
}

/// A film with a box filter.
pub fn film(width: u32, height: u32) -> String {
    format!(
        "<film type='hdrfilm'><integer name='width' value='{width}'/><integer name='height' value='{height}'/>
           <rfilter type='box'/></film>"
    )
}

/// A point as the format has it.
pub fn point([x, y, z]: [f64; 3]) -> String {
    format!("{x}, {y}, {z}")
}

/// A diffuse surface.
pub fn diffuse(albedo: f64) -> String {
    format!("<bsdf type='diffuse'><rgb name='reflectance' value='{albedo}'/></bsdf>")
}

/// An emitter of that radiance on a surface.
pub fn glowing(radiance: f64) -> String {
    format!("<emitter type='area'><rgb name='radiance' value='{radiance}'/></emitter>")
}

/// A sphere with something.
pub fn sphere(center: [f64; 3], radius: f64, inwards: bool, with: &str) -> String {
    format!(
        "<shape type='sphere'><point name='center' value='{}'/><float name='radius' value='{radius}'/>
           <boolean name='flip_normals' value='{inwards}'/>{with}</shape>",
        point(center)
    )
}

/// A cube seen from inside, of half the size `half`, turned about two axes, with something.
pub fn room(center: [f64; 3], half: f64, with: &str) -> String {
    format!(
        "<shape type='cube'><boolean name='flip_normals' value='true'/>
           <transform name='to_world'><rotate x='1' angle='25'/><rotate y='1' angle='40'/><scale value='{half}'/>
             <translate value='{}'/></transform>{with}</shape>",
        point(center)
    )
}

/// A white sky.
pub const SKY: &str = "<emitter type='constant'><rgb name='radiance' value='1'/></emitter>";

/// Σ aⁱ over i < n: what walls that glow by 1 and reflect a look like, if paths have n edges at most.
pub fn series(albedo: f64, n: i32) -> f64 {
    if albedo == 1.0 { f64::from(n) } else { (1.0 - albedo.powi(n)) / (1.0 - albedo) }
}

/// Radiance of the wall of an integrating sphere of radius 1 and diffuse albedo a about a black concentric one of radius r
/// that glows by 1, as paths of up to n edges find it.
///
/// The wall gets π r² from the light directly, everywhere; of what leaves the wall the part 1 − r² comes back to it, as
/// evenly (the rest meets the light): E = π r² Σ (a (1 − r²))ⁱ, i < n − 1, and it shows a E/π.
pub fn integrating_sphere(albedo: f64, r: f64, n: i32) -> f64 {
    albedo * r * r * series(albedo * (1.0 - r * r), n - 1)
}

/// A rectangle of half the size `half`, in the plane z = 0 and facing up, turned, then moved, with something.
pub fn rectangle([x, y]: [f64; 2], turn: &str, place: [f64; 3], with: &str) -> String {
    format!(
        "<shape type='rectangle'><transform name='to_world'><scale x='{x}' y='{y}'/>{turn}<translate value='{}'/></transform>
           {with}</shape>",
        point(place)
    )
}
