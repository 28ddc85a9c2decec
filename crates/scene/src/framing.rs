//! The default camera: the tightest view of a scene's vertices from a given direction.
//!
//! Extreme points decide it: see [`Camera::fitting`]. Everything is in f64 and relative to an anchor in the middle of
//! the scene, so a scene far from the origin is framed as one at the origin.

use glam::{DAffine3, DMat3, DVec3, Vec3};

use super::{Bounds, Camera, Instance, Mesh, Projection, Scene};

/// Part of the picture's limiting side that stays free at each end.
pub const MARGIN: f64 = 0.08;

/// Direction from the scene to the default camera: in front, somewhat to the right and above.
const FROM_THE_RIGHT: DVec3 = DVec3::new(0.4, 0.35, 1.0);

/// A scene whose depth along Z is at most this fraction of its width and of its height is a chart or a sheet, and seen
/// from the front. Of the sample models all charts with labels have at most 0.2; a man with spread arms has 0.27.
const SHEET: f64 = 0.25;

/// A ground is this many times wider and deeper than what stands on it. Below that, it is a part of the object: a
/// plinth, a table.
const GROUND: f64 = 3.0;

/// Height of a ground over its width, at most.
const FLAT: f64 = 0.01;

/// Largest number of steps of [`centred`]. Each step changes an extreme vertex, and a few suffice.
const STEPS: u32 = 32;

impl Bounds {
    /// The corner that lies farthest in `direction`, relative to the centre.
    fn farthest(&self, direction: DVec3) -> DVec3 {
        (self.max - self.min) * 0.5 * direction.map(f64::signum)
    }

    fn union(self, other: Self) -> Self {
        Self { min: self.min.min(other.min), max: self.max.max(other.max) }
    }
}

impl Camera {
    /// A camera in front of a box, somewhat to the right and above, with the box just inside the picture.
    #[must_use]
    pub fn framing(bounds: Bounds, aspect: f64, fov_y: f64) -> Self {
        Self::facing(bounds, aimed(bounds, aspect, fov_y), aspect, fov_y)
    }

    /// A camera in front of a box that looks along −Z of `frame`, with the box just inside the picture.
    #[must_use]
    pub fn facing(bounds: Bounds, frame: DMat3, aspect: f64, fov_y: f64) -> Self {
        Self::fitting(bounds.center(), &|n| bounds.farthest(n), frame, aspect, fov_y)
    }

    /// The nearest perspective camera with the axes `frame` (right, up, backward) that sees all points of a set inside
    /// the margin, with equal room at opposite sides of the picture.
    ///
    /// `farthest` gives the point of the set that lies farthest in a direction, relative to `anchor`. With (x, y, z)
    /// along the axes and the eye e, a point is inside the right side of a frustum of slope t when x − e_x ≤ t (e_z −
    /// z), or x + t z ≤ e_x + t e_z. The largest x + t z of all points is that of one extreme point, a; with b, the
    /// largest −x + t z, both sides hold when 2 t e_z ≥ a + b, and both points touch when these are equal and e_x =
    /// (a − b) / 2. The larger e_z of the two axes decides. No box or sphere is in between, so no room is lost.
    #[must_use]
    pub fn fitting(anchor: DVec3, farthest: &dyn Fn(DVec3) -> DVec3, frame: DMat3, aspect: f64, fov_y: f64) -> Self {
        let [right, up, backward] = [frame.x_axis, frame.y_axis, frame.z_axis];
        let slope = (fov_y * 0.5).tan() * (1.0 - 2.0 * MARGIN);
        let least = |axis: DVec3, t: f64| {
            let reach = |n: DVec3| farthest(n).dot(n);
            (reach(axis + backward * t) + reach(backward * t - axis)) / (2.0 * t)
        };
        let nearest = farthest(backward).dot(backward);
        let deepest = farthest(-backward).dot(-backward);
        let fitted = least(right, slope * aspect).max(least(up, slope));
        // A needle that points at the eye, and a point, have no width: stay away by the needle's length, or a metre.
        let depth = nearest + deepest;
        let distance = fitted.max(nearest + depth * 1e-3);
        let distance = if distance - nearest > 0.0 { distance } else { nearest + 1.0 };
        let eye = right * centred(farthest, right, backward, distance)
            + up * centred(farthest, up, backward, distance)
            + backward * distance;
        Self {
            name: "framing".to_owned(),
            world_from_camera: DAffine3::from_mat3_translation(frame, anchor + eye),
            projection: Projection::Perspective { fov_y, near: None },
        }
    }
}

/// Coordinate of the eye along `axis` at which both outermost points are equally far from the middle of the picture,
/// for an eye at `distance` along `backward`.
///
/// Sought is the slope t with a(t) + b(t) = 2 t `distance`, in the notation of [`Camera::fitting`]. The left side is
/// convex and piecewise linear, so Newton's iteration from t = 0 rises to the root and ends when the two extreme points
/// stay the same.
fn centred(farthest: &dyn Fn(DVec3) -> DVec3, axis: DVec3, backward: DVec3, distance: f64) -> f64 {
    let mut t = 0.0;
    let mut middle = 0.0;
    for _ in 0..STEPS {
        let (a, b) = (farthest(axis + backward * t), farthest(backward * t - axis));
        middle = 0.5 * ((a - b).dot(backward) * t + (a + b).dot(axis));
        let next = (a - b).dot(axis) / (2.0 * distance - (a + b).dot(backward));
        if next <= t || next.is_nan() {
            break;
        }
        t = next;
    }
    middle
}

/// Axes of a camera whose eye lies in the direction [`FROM_THE_RIGHT`] of the middle of a box, with the box in the
/// middle of its picture.
///
/// Fitted along that direction itself, the eye goes sideways and down until the box is in the middle, for its near side
/// is larger: a cube no longer shows its top. So the camera is turned until the eye lies where it should. Each step
/// adds what is missing to the axis; 16 leave less than a millionth for boxes from plates to needles.
fn aimed(bounds: Bounds, aspect: f64, fov_y: f64) -> DMat3 {
    let wanted = FROM_THE_RIGHT.normalize();
    let mut backward = wanted;
    for _ in 0..16 {
        let eye = Camera::facing(bounds, frame(backward), aspect, fov_y).world_from_camera.translation;
        let missing = wanted - (eye - bounds.center()).normalize_or(wanted);
        backward = (backward + missing).normalize_or(wanted);
    }
    frame(backward)
}

/// Right-handed axes (right, up, backward) of an upright camera that looks against `backward`.
fn frame(backward: DVec3) -> DMat3 {
    let backward = backward.normalize();
    let right = DVec3::Y.cross(backward).normalize();
    DMat3::from_cols(right, backward.cross(right), backward)
}

/// The vertices of a mesh that its triangles use.
struct UsedVertices<'a> {
    mesh: &'a Mesh,
    is_used: Vec<bool>,
}

impl<'a> UsedVertices<'a> {
    fn of(mesh: &'a Mesh) -> Self {
        let mut is_used = vec![false; mesh.positions.len()];
        for &index in mesh.indices.iter() {
            is_used[index as usize] = true;
        }
        for (position, is_used) in mesh.positions.iter().zip(&mut is_used) {
            *is_used &= Vec3::from(*position).is_finite();
        }
        Self { mesh, is_used }
    }

    fn points(&self) -> impl Iterator<Item = DVec3> {
        let used = self.mesh.positions.iter().zip(&self.is_used).filter(|(_, is_used)| **is_used);
        used.map(|(position, _)| Vec3::from(*position).as_dvec3())
    }
}

/// World-space box of an instance's vertices.
fn bounds_of(instance: &Instance, used: &UsedVertices<'_>) -> Option<Bounds> {
    let points = used.points().map(|p| instance.world_from_object.transform_point3(p)).filter(|p| p.is_finite());
    points.map(|p| Bounds { min: p, max: p }).reduce(Bounds::union)
}

/// Whether an instance is the ground below the rest: flat, level, and far larger.
fn is_ground(ground: &Bounds, rest: &Bounds) -> bool {
    let (of_ground, of_rest) = (ground.max - ground.min, rest.max - rest.min);
    is_level(ground)
        && of_ground.x >= GROUND * of_rest.x
        && of_ground.z >= GROUND * of_rest.z
        && ground.max.y <= rest.min.y + 0.1 * of_rest.y
}

fn is_level(bounds: &Bounds) -> bool {
    let size = bounds.max - bounds.min;
    size.y <= FLAT * size.x.min(size.z)
}

impl Scene {
    /// A camera that frames the scene: every vertex that is drawn is inside the picture, and the outermost two of one
    /// side are [`MARGIN`] from its ends. `None` for a scene without triangles.
    ///
    /// A sheet along X and Y is seen from the front, everything else from somewhat to the right and above. A ground far
    /// larger than what stands on it does not count: it is cut by the picture, as in a photograph.
    #[must_use]
    pub fn framing(&self, aspect: f64, fov_y: f64) -> Option<Camera> {
        let subject = Framed::of(self)?;
        let size = subject.bounds.max - subject.bounds.min;
        let is_sheet = size.z <= SHEET * size.x.min(size.y);
        let axes = if is_sheet { frame(DVec3::Z) } else { aimed(subject.bounds, aspect, fov_y) };
        let farthest = |n: DVec3| subject.farthest(n);
        Some(Camera::fitting(subject.bounds.center(), &farthest, axes, aspect, fov_y))
    }

    /// The same for a scene that is turned about the axis `up` through `center`: it is inside the picture at each turn.
    #[must_use]
    pub fn framing_of_turns(&self, center: DVec3, up: DVec3, aspect: f64, fov_y: f64) -> Option<Camera> {
        let subject = Framed::of(self)?;
        let up = up.normalize_or(DVec3::Y);
        // Distance from the axis, and height along it.
        let circles: Vec<[f64; 2]> = subject
            .points()
            .map(|p| {
                let (p, height) = (p - center, (p - center).dot(up));
                [(p - up * height).length(), height]
            })
            .collect();
        let farthest = |n: DVec3| {
            let outwards = (n - up * n.dot(up)).normalize_or_zero();
            let points = circles.iter().map(|[radius, height]| outwards * *radius + up * *height);
            points.reduce(|a, b| if b.dot(n) > a.dot(n) { b } else { a }).unwrap_or_default()
        };
        Some(Camera::fitting(center, &farthest, aimed(subject.bounds, aspect, fov_y), aspect, fov_y))
    }
}

/// What a default camera frames: the instances of a scene without a ground far larger than they are.
struct Framed<'a> {
    used: Vec<UsedVertices<'a>>,
    placed: Vec<(&'a Instance, Bounds)>,
    bounds: Bounds,
}

impl<'a> Framed<'a> {
    fn of(scene: &'a Scene) -> Option<Self> {
        let used: Vec<UsedVertices<'_>> = scene.meshes.iter().map(UsedVertices::of).collect();
        let mut placed: Vec<(&Instance, Bounds)> = scene
            .instances
            .iter()
            .filter_map(|instance| Some((instance, bounds_of(instance, &used[instance.mesh])?)))
            .collect();
        let all = |placed: &[(&Instance, Bounds)], counts: fn(&Bounds) -> bool| {
            placed.iter().map(|(_, bounds)| *bounds).filter(counts).reduce(Bounds::union)
        };
        if let Some(standing) = all(&placed, |bounds| !is_level(bounds)) {
            placed.retain(|(_, bounds)| !is_ground(bounds, &standing));
        }
        let bounds = all(&placed, |_| true)?;
        Some(Self { used, placed, bounds })
    }

    fn points(&self) -> impl Iterator<Item = DVec3> {
        self.placed.iter().flat_map(|(instance, _)| {
            self.used[instance.mesh].points().map(|p| instance.world_from_object.transform_point3(p))
        })
    }

    /// The vertex that lies farthest in a direction, relative to the middle.
    fn farthest(&self, n: DVec3) -> DVec3 {
        let anchor = self.bounds.center();
        let mut best = (f64::NEG_INFINITY, DVec3::ZERO);
        for (instance, around) in &self.placed {
            // Most instances lie inside of what others reach, which their box tells.
            if (around.center() - anchor + around.farthest(n)).dot(n) <= best.0 {
                continue;
            }
            let DAffine3 { matrix3, translation } = instance.world_from_object;
            let (along, offset) = (matrix3.transpose() * n, translation - anchor);
            let reached = self.used[instance.mesh].points().map(|p| (along.dot(p), p));
            let Some((_, p)) = reached.reduce(|a, b| if b.0 > a.0 { b } else { a }) else { continue };
            let p = matrix3 * p + offset;
            if p.dot(n) > best.0 {
                best = (p.dot(n), p);
            }
        }
        best.1
    }
}

#[cfg(test)]
mod tests {
    use glam::DQuat;

    use super::*;

    const FOV: f64 = 0.7;

    /// A scene of one-triangle meshes; each instance has the mesh of its number.
    fn scene(triangles: &[[DVec3; 3]], place: impl Fn(usize) -> DAffine3) -> Scene {
        let mesh = |corners: &[DVec3; 3]| Mesh {
            positions: corners.iter().map(|p| p.as_vec3().to_array()).collect(),
            indices: vec![0, 1, 2].into(),
            ..Mesh::default()
        };
        let instance = |mesh| Instance { name: String::new(), mesh, world_from_object: place(mesh) };
        Scene {
            meshes: triangles.iter().map(mesh).collect(),
            instances: (0..triangles.len()).map(instance).collect(),
            ..Scene::default()
        }
    }

    /// Numbers in −1 … 1 of a linear congruential generator (Knuth's MMIX).
    fn numbers(mut state: u64) -> impl FnMut() -> f64 {
        move || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
        }
    }

    fn random(seed: u64, offset: DVec3) -> Scene {
        let mut next = numbers(seed);
        let mut point = |size: f64| DVec3::new(next(), next(), next()) * size;
        let stretch = point(3.0).abs() + 0.1;
        let triangles: Vec<[DVec3; 3]> = (0..40).map(|_| [point(1.0), point(1.0), point(1.0)]).collect();
        let places: Vec<DAffine3> = (0..40)
            .map(|i| {
                let turn = DQuat::from_scaled_axis(point(3.0));
                let scale = if i % 3 == 0 { DVec3::new(-1.0, 0.5, 2.0) } else { DVec3::ONE };
                let at = DAffine3::from_scale_rotation_translation(scale, turn, point(4.0) * stretch);
                DAffine3::from_translation(offset) * at
            })
            .collect();
        scene(&triangles, |i| places[i])
    }

    fn vertices(scene: &Scene) -> Vec<DVec3> {
        let of = |i: &Instance| {
            let placed = |p: &[f32; 3]| i.world_from_object.transform_point3(Vec3::from(*p).as_dvec3());
            scene.meshes[i.mesh].positions.iter().map(placed).collect::<Vec<_>>()
        };
        scene.instances.iter().flat_map(of).collect()
    }

    /// Least and largest place in the picture, −1 … 1 from side to side, of points that lie before the camera.
    fn seen(camera: &Camera, aspect: f64, points: &[DVec3]) -> [[f64; 2]; 2] {
        let Projection::Perspective { fov_y, .. } = camera.projection else { panic!("perspective") };
        let mut all = [[f64::INFINITY, f64::NEG_INFINITY]; 2];
        for p in points {
            let p = camera.world_from_camera.inverse().transform_point3(*p);
            assert!(p.z < 0.0, "{p} is behind the camera");
            let slope = (fov_y / 2.0).tan();
            for (range, x) in all.iter_mut().zip([p.x / -p.z / slope / aspect, p.y / -p.z / slope]) {
                *range = [range[0].min(x), range[1].max(x)];
            }
        }
        all
    }

    #[test]
    fn every_vertex_is_in_the_picture_and_the_outermost_touch_the_margin() {
        for seed in 1..60 {
            let scene = random(seed, DVec3::ZERO);
            for aspect in [0.4, 1.0, 16.0 / 9.0] {
                let [x, y] = seen(&scene.framing(aspect, FOV).unwrap(), aspect, &vertices(&scene));
                for [least, largest] in [x, y] {
                    assert!((least + largest).abs() < 1e-9, "the middle: {least} … {largest}");
                }
                let reach = x[1].max(y[1]);
                assert!((reach - 0.84).abs() < 1e-9, "seed {seed}, aspect {aspect}: {x:?} {y:?}");
            }
        }
    }

    #[test]
    fn a_sheet_is_seen_from_the_front_at_the_distance_of_its_half_width() {
        let sheet = |w: f64, h: f64| {
            let corner = |x: f64, y: f64| DVec3::new(x * w + 5.0, y * h, 7.0);
            let triangles = [
                [corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0)],
                [corner(-1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)],
            ];
            scene(&triangles, |_| DAffine3::IDENTITY)
        };
        let right_angle = std::f64::consts::FRAC_PI_2;
        // The slope of half of 90° is 1, so the half side is 0.84 of the distance.
        for (w, h, aspect, distance) in [(1.0, 1.0, 1.0, 1.0), (4.0, 1.0, 2.0, 2.0), (4.0, 3.0, 2.0, 3.0)] {
            let camera = sheet(w, h).framing(aspect, right_angle).unwrap();
            let expected = DVec3::new(5.0, 0.0, 7.0 + distance / 0.84);
            assert!(camera.world_from_camera.translation.abs_diff_eq(expected, 1e-9), "{camera:?}");
            assert_eq!(camera.world_from_camera.matrix3, DMat3::IDENTITY);
        }
    }

    #[test]
    fn scenes_far_away_are_framed_as_those_at_the_origin() {
        // A power of two: the places of the instances lose only bits below 2⁻²² m.
        let away = DVec3::new(f64::from(1 << 30), -f64::from(1 << 29), f64::from(1 << 30));
        let (near, far) = (random(7, DVec3::ZERO), random(7, away));
        let [near, far] = [near, far].map(|scene| scene.framing(1.5, FOV).unwrap().world_from_camera);
        assert!(
            (far.translation - away).abs_diff_eq(near.translation, 1e-5),
            "{} {}",
            far.translation - away,
            near.translation
        );
        assert!(far.matrix3.abs_diff_eq(near.matrix3, 1e-6), "{far:?} {near:?}");
    }

    #[test]
    fn thin_and_empty_scenes_have_a_camera_or_none() {
        assert!(Scene::default().framing(1.0, FOV).is_none());
        let invalid = scene(&[[DVec3::NAN; 3]], |_| DAffine3::IDENTITY);
        assert!(invalid.framing(1.0, FOV).is_none());
        let toward = FROM_THE_RIGHT.normalize();
        let needles = [DVec3::X, DVec3::Y, DVec3::Z, toward].map(|n| [DVec3::ONE, DVec3::ONE + n, DVec3::ONE - n]);
        for triangle in [[DVec3::ONE; 3]].into_iter().chain(needles) {
            let scene = scene(&[triangle], |_| DAffine3::IDENTITY);
            let camera = scene.framing(1.5, FOV).unwrap();
            assert!(camera.world_from_camera.is_finite(), "{camera:?}");
            let [x, y] = seen(&camera, 1.5, &vertices(&scene));
            assert!([x, y].iter().flatten().all(|x| x.abs() < 0.85), "{x:?} {y:?}");
        }
        // A vertex that no triangle uses is not seen.
        let mut stray = scene(&[[DVec3::ZERO, DVec3::X, DVec3::ONE]], |_| DAffine3::IDENTITY);
        let camera = stray.framing(1.0, FOV);
        stray.meshes[0].positions = [[0.0; 3], [1.0, 0.0, 0.0], [1.0; 3], [99.0; 3]].into_iter().collect();
        assert_eq!(stray.framing(1.0, FOV), camera);
    }

    #[test]
    fn a_large_ground_is_cut_and_a_plinth_is_not() {
        let body = [DVec3::new(-1.0, 0.0, -1.0), DVec3::new(1.0, 0.0, 1.0), DVec3::new(0.0, 2.0, 0.0)];
        let ground =
            |size: f64, y: f64| [DVec3::new(-size, y, -size), DVec3::new(size, y, -size), DVec3::new(0.0, y, size)];
        let framed = |triangles: &[[DVec3; 3]]| scene(triangles, |_| DAffine3::IDENTITY).framing(1.5, FOV);
        let alone = framed(&[body]);
        assert_eq!(framed(&[body, ground(50.0, 0.0)]), alone);
        assert_ne!(framed(&[body, ground(2.0, 0.0)]), alone, "a plinth");
        assert_ne!(framed(&[body, ground(50.0, 2.0)]), alone, "a roof");
        assert!(framed(&[ground(50.0, 0.0)]).is_some(), "a ground alone");
    }

    #[test]
    fn a_turned_scene_stays_in_the_picture() {
        let scene = random(3, DVec3::new(20.0, 5.0, -3.0));
        let center = scene.bounds().unwrap().center();
        let camera = scene.framing_of_turns(center, DVec3::Y, 1.5, FOV).unwrap();
        let mut reach = 0.0_f64;
        for step in 0..3600 {
            let turn = DQuat::from_rotation_y(f64::from(step) * 0.1_f64.to_radians());
            let turned: Vec<DVec3> = vertices(&scene).iter().map(|p| center + turn * (*p - center)).collect();
            reach = reach.max(seen(&camera, 1.5, &turned).iter().flatten().fold(0.0, |a, x| a.max(x.abs())));
        }
        assert!(reach < 0.84 + 1e-9 && reach > 0.8399, "{reach}");
    }
}
