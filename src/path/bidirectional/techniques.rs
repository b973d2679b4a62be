//! Which techniques a mapping combines.

/// The techniques (s, t) of making a path from s vertices of a light subpath and t of a camera subpath, the place on the
/// lens included, that are compared with one another.
///
/// A path of n edges has s + t = n + 1 vertices, so there are up to n + 1 ways to make it. t = 0, a light subpath that
/// hits the lens, is never one of them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Techniques {
    /// s = 0: the camera subpath hits a light.
    pub hit: bool,
    /// s = 1, t ≥ 2: next-event estimation.
    pub next_event: bool,
    /// t = 1, s ≥ 2: a vertex of the light subpath is connected to the camera.
    pub light: bool,
    /// t = 1, s = 1: a place on a light is connected to the camera.
    pub lamp: bool,
    /// s ≥ 2, t ≥ 2: vertices of both are connected.
    pub inner: bool,
}

impl Techniques {
    const NONE: Techniques = Techniques { hit: false, next_event: false, light: false, lamp: false, inner: false };
    /// Path tracing.
    pub const CAMERA: Techniques = Techniques { hit: true, next_event: true, ..Techniques::NONE };
    /// Light tracing.
    pub const LIGHT: Techniques = Techniques { light: true, lamp: true, ..Techniques::NONE };
    /// Both.
    pub const TWO_WAY: Techniques = Techniques { light: true, ..Techniques::CAMERA };
    /// Bidirectional path tracing. Lamps that are seen directly need no third technique.
    pub const ALL: Techniques = Techniques { inner: true, ..Techniques::TWO_WAY };

    /// Whether paths are made with s light vertices and t camera vertices.
    pub fn has(self, s: u16, t: u16) -> bool {
        match (s, t) {
            (_, 0) | (0, 1) => false,
            (0, _) => self.hit,
            (1, 1) => self.lamp,
            (1, _) => self.next_event,
            (_, 1) => self.light,
            _ => self.inner,
        }
    }

    /// Whether some paths can be made in several ways. Others need no weights.
    #[inline(always)]
    pub fn weigh(self) -> bool {
        self.light && self.follow_camera() || self.hit && self.next_event
    }

    /// Whether camera subpaths are followed beyond the lens.
    pub fn follow_camera(self) -> bool {
        self.hit || self.next_event || self.inner
    }
}
