//! Camera navigation: orbit, pan, zoom (dolly), look around and fly, with the conventions of desktop viewers.
//! Independent of the window, so that tests can drive it.

use glam::{DAffine3, DMat3, DQuat, DVec2, DVec3};

use etalon::scene::{Bounds, Camera, Projection};

/// Rotation in radians for a drag over the height of the window.
const TURN: f64 = std::f64::consts::PI;
/// Factor of the distance for one step of the wheel.
const STEP: f64 = 0.85;
/// Range of the distance to the orbit centre, as fractions of the size of the scene.
const NEAREST: f64 = 1e-4;
const FARTHEST: f64 = 1e3;
/// Least angle in radians between the viewing direction and the vertical, where an orbit has no horizon.
const POLE: f64 = 1e-3;
/// Aspect ratio that cameras of a file are made for; glTF's own is not read.
const MADE_FOR: f64 = 16.0 / 9.0;

/// A view that can be returned to.
#[derive(Debug, Clone, PartialEq)]
pub struct View {
    camera: Camera,
    distance: f64,
    moved: bool,
    named: Option<String>,
    fits: Option<f64>,
}

/// Directions that a scene is looked at from, as in drawings; the front of a glTF model is +Z.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ViewSide {
    /// From +Z.
    Front,
    /// From −Z.
    Back,
    /// From +X.
    Right,
    /// From −X.
    Left,
    /// From +Y.
    Top,
    /// From −Y.
    Bottom,
}

impl ViewSide {
    /// Every side with its name.
    pub const ALL: [(Self, &str); 6] = [
        (Self::Front, "Front"),
        (Self::Back, "Back"),
        (Self::Right, "Right"),
        (Self::Left, "Left"),
        (Self::Top, "Top"),
        (Self::Bottom, "Bottom"),
    ];

    /// Unit vector from the scene to the eye.
    #[must_use]
    pub fn direction(self) -> DVec3 {
        match self {
            Self::Front => DVec3::Z,
            Self::Back => DVec3::NEG_Z,
            Self::Right => DVec3::X,
            Self::Left => DVec3::NEG_X,
            Self::Top => DVec3::Y,
            Self::Bottom => DVec3::NEG_Y,
        }
    }
}

/// A camera with an orbit centre.
#[derive(Debug, Clone)]
pub struct Navigation {
    view: Camera,
    /// Distance to the orbit centre in metres.
    distance: f64,
    /// Size of the scene in metres.
    size: f64,
    bounds: Bounds,
    home: Camera,
    /// Whether the user moved the camera, or it was computed to frame the scene at one size.
    moved: bool,
    /// Key of the file's camera that was chosen; `None`: the initial one.
    named: Option<String>,
    /// Aspect ratio that the initial camera was computed for, to frame the scene; `None` for other cameras.
    framed: Option<f64>,
    /// Aspect ratio that the current view was computed for, to frame something; `None` for other views.
    fits: Option<f64>,
}

impl Navigation {
    /// Starts at a camera. `framed`: the aspect ratio that it was computed for, to frame the scene.
    #[must_use]
    pub fn new(home: Camera, bounds: Bounds, framed: Option<f64>) -> Self {
        let size = bounds.radius().max(1e-6);
        let mut new = Self {
            view: home.clone(),
            distance: size,
            size,
            bounds,
            home,
            moved: framed.is_some(),
            named: None,
            framed,
            fits: framed,
        };
        new.distance = new.distance_to_middle();
        new
    }

    /// The current camera. A moved camera is rebuilt from the rounded options of [`Navigation::words`], so that the
    /// copied command draws the same picture.
    #[must_use]
    pub fn camera(&self) -> Camera {
        self.words().map_or_else(|| self.view.clone(), |(camera, _)| camera)
    }

    /// The current camera as `--eye`, `--target`, `--fov` and, where +Y is not up in the picture, `--up`, with the
    /// camera that these options give. `None` where the camera was not moved, or is orthographic.
    #[must_use]
    pub fn words(&self) -> Option<(Camera, String)> {
        let Projection::Perspective { fov_y, .. } = self.view.projection else { return None };
        // Rounded to a millionth, so that the options are short.
        let short = |x: f64| (x * 1e6).round() / 1e6;
        let point = |p: DVec3| DVec3::new(short(p.x), short(p.y), short(p.z));
        let (eye, target, degrees) = (point(self.eye()), point(self.target()), short(fov_y.to_degrees()));
        let up = point(self.up());
        let camera = Camera::looking_at(eye, target, up, degrees.to_radians()).ok().filter(|_| self.moved)?;
        let list = |p: DVec3| format!("{},{},{}", p.x, p.y, p.z);
        let rolled = if up == DVec3::Y { String::new() } else { format!(" --up {}", list(up)) };
        Some((camera, format!("--eye {} --target {} --fov {degrees}{rolled}", list(eye), list(target))))
    }

    /// Direction that is up in the picture: +Y, unless the camera is rolled or looks straight up or down.
    fn up(&self) -> DVec3 {
        let frame = self.view.world_from_camera.matrix3;
        let is_upright = frame.x_axis.y.abs() < 1e-6 && frame.y_axis.y > 0.5 * POLE;
        if is_upright { DVec3::Y } else { frame.y_axis }
    }

    /// Whether the user moved the camera, or it was computed to frame the scene.
    #[must_use]
    pub fn moved(&self) -> bool {
        self.moved
    }

    /// Key of the file's camera that was chosen; `None`: the initial one.
    #[must_use]
    pub fn named(&self) -> Option<&str> {
        self.named.as_deref()
    }

    /// Centre of the orbit in world space.
    #[must_use]
    pub fn target(&self) -> DVec3 {
        self.eye() + self.forward() * self.distance
    }

    /// Position of the camera in world space.
    #[must_use]
    pub fn eye(&self) -> DVec3 {
        self.view.world_from_camera.translation
    }

    fn forward(&self) -> DVec3 {
        -self.view.world_from_camera.matrix3.z_axis
    }

    /// Distance along the viewing direction to the point nearest to the middle of the scene.
    fn distance_to_middle(&self) -> f64 {
        (self.bounds.center() - self.eye()).dot(self.forward()).max(0.05 * self.size)
    }

    /// The current view, to return to.
    #[must_use]
    pub fn view(&self) -> View {
        let Self { view, distance, moved, named, fits, .. } = self;
        View { camera: view.clone(), distance: *distance, moved: *moved, named: named.clone(), fits: *fits }
    }

    /// Returns to a view.
    pub fn return_to(&mut self, to: View) {
        (self.view, self.distance, self.moved, self.named, self.fits) =
            (to.camera, to.distance, to.moved, to.named, to.fits);
    }

    /// The least aspect ratio of a picture of this view: in a narrower one, the sides would be cut off.
    #[must_use]
    pub fn least_aspect(&self) -> f64 {
        self.fits.unwrap_or(MADE_FOR)
    }

    /// Takes over a scene that was read again. A view that the user moved stays where it is; a camera of the file is
    /// that of the new scene, `named` if it was chosen by name. Where that is gone, the view stays.
    pub fn stay(&mut self, home: Camera, named: Option<&Camera>, bounds: Bounds, framed: Option<f64>) {
        self.moved |= framed.is_some() && self.framed.is_none() || self.named.is_some() && named.is_none();
        (self.home, self.bounds, self.size, self.framed) = (home, bounds, bounds.radius().max(1e-6), framed);
        self.follow(named);
    }

    /// Follows a change of the animation time: a camera of the file moves with its node unless the user moved it.
    pub fn moment(&mut self, home: Camera, named: Option<&Camera>) {
        if self.framed.is_none() {
            self.home = home;
            self.follow(named);
        }
    }

    /// Takes the place of the camera of the file that is looked through.
    fn follow(&mut self, named: Option<&Camera>) {
        if !self.moved {
            self.view = named.unwrap_or(&self.home).clone();
            self.distance = self.distance_to_middle();
        }
    }

    /// Returns to the initial camera.
    pub fn reset(&mut self) {
        self.go_to(self.home.clone(), None);
        (self.moved, self.fits) = (self.framed.is_some(), self.framed);
    }

    /// Goes to a camera; `key` is the word that chooses it in the file.
    pub fn go_to(&mut self, camera: Camera, key: Option<String>) {
        self.view = camera;
        (self.moved, self.fits) = (false, None);
        self.named = key;
        self.distance = self.distance_to_middle();
    }

    /// Frames the whole scene without changing the viewing direction.
    pub fn fit(&mut self, aspect: f64) {
        self.fit_box(self.bounds, aspect);
    }

    /// Frames the whole scene, seen from a side.
    pub fn look_from(&mut self, side: ViewSide, aspect: f64) {
        // Straight up and down there is no horizon for an orbit.
        let direction = (side.direction() + DVec3::Z * (POLE * side.direction().y.abs())).normalize();
        let (center, distance) = (self.bounds.center(), 2.0 * self.size);
        if let Ok(camera) = Camera::looking_at(center + direction * distance, center, DVec3::Y, 1.0) {
            self.view.world_from_camera = camera.world_from_camera;
        }
        self.fit(aspect);
    }

    /// Frames a box without changing the viewing direction.
    pub fn fit_box(&mut self, bounds: Bounds, aspect: f64) {
        (self.moved, self.fits) = (true, Some(aspect));
        let size = bounds.radius().max(1e-6);
        match &mut self.view.projection {
            Projection::Perspective { fov_y, .. } => {
                let frame = self.view.world_from_camera.matrix3;
                self.view.world_from_camera = Camera::facing(bounds, frame, aspect, *fov_y).world_from_camera;
                self.distance = (bounds.center() - self.eye()).dot(self.forward()).max(0.05 * size);
            }
            Projection::Orthographic { half_height, .. } => {
                *half_height = size / aspect.min(1.0);
                self.distance = 2.0 * size;
                self.view.world_from_camera.translation = bounds.center() - self.forward() * self.distance;
            }
        }
    }

    /// Rotates the camera about an axis through the point `pivot`.
    fn turn(&mut self, about: DVec3, pivot: DVec3, angle: f64) {
        self.moved = true;
        let turn = DMat3::from_quat(DQuat::from_axis_angle(about, angle));
        let frame = self.view.world_from_camera;
        let eye = pivot + turn * (frame.translation - pivot);
        self.view.world_from_camera = DAffine3::from_mat3_translation(turn * frame.matrix3, eye);
    }

    /// The tilt in radians, limited so that the elevation stays off the poles.
    fn tilt(&self, wanted: f64) -> f64 {
        let elevation = self.forward().y.clamp(-1.0, 1.0).asin();
        let limit = std::f64::consts::FRAC_PI_2 - POLE;
        (elevation + wanted).clamp(-limit.max(elevation.abs()), limit.max(elevation.abs())) - elevation
    }

    fn turned(&mut self, by: DVec2, pivot: DVec3) {
        self.turn(DVec3::Y, pivot, -by.x * TURN);
        let right = self.view.world_from_camera.matrix3.x_axis;
        self.turn(right, pivot, self.tilt(-by.y * TURN));
    }

    /// Turns towards a point, which becomes the orbit centre, and halves the distance to it.
    pub fn focus(&mut self, at: DVec3) {
        self.moved = true;
        let from = self.eye() - at;
        let Ok(turned) = Camera::looking_at(at + from * 0.5, at, self.up(), 1.0) else { return };
        self.view.world_from_camera = turned.world_from_camera;
        self.distance = 0.5 * from.length();
    }

    /// Orbits about the orbit centre; `by` is a drag in window heights.
    pub fn orbit(&mut self, by: DVec2) {
        self.turned(by, self.target());
    }

    /// Looks around: rotates about the eye.
    pub fn look(&mut self, by: DVec2) {
        self.turned(by, self.eye());
    }

    /// Pans parallel to the picture; a point at the distance of the orbit centre stays under the pointer.
    pub fn pan(&mut self, by: DVec2) {
        let height = match self.view.projection {
            Projection::Perspective { fov_y, .. } => 2.0 * (fov_y * 0.5).tan() * self.distance,
            Projection::Orthographic { half_height, .. } => 2.0 * half_height,
        };
        self.moved = true;
        let frame = &mut self.view.world_from_camera;
        frame.translation += (frame.matrix3.y_axis * by.y - frame.matrix3.x_axis * by.x) * height;
    }

    /// Dollies towards the orbit centre (positive) or away, in steps of the wheel.
    pub fn zoom(&mut self, steps: f64) {
        self.moved = true;
        let target = self.target();
        self.distance = (self.distance * STEP.powf(steps)).clamp(NEAREST * self.size, FARTHEST * self.size);
        if let Projection::Orthographic { half_height, .. } = &mut self.view.projection {
            *half_height = (*half_height * STEP.powf(steps)).max(NEAREST * self.size);
        }
        self.view.world_from_camera.translation = target - self.forward() * self.distance;
    }

    /// Flies right, up and forwards, in sizes of the scene.
    pub fn fly(&mut self, by: DVec3) {
        self.moved = true;
        let frame = &mut self.view.world_from_camera;
        let way = frame.matrix3.x_axis * by.x + DVec3::Y * by.y - frame.matrix3.z_axis * by.z;
        frame.translation += way * self.size;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn navigation() -> Navigation {
        let bounds = Bounds { min: DVec3::new(-1.0, 0.0, -2.0), max: DVec3::new(3.0, 2.0, 1.0) };
        Navigation::new(Camera::framing(bounds, 1.5, 0.7), bounds, None)
    }

    fn is_upright(view: &Camera) -> bool {
        let frame = view.world_from_camera.matrix3;
        let rigid = (frame.transpose() * frame).abs_diff_eq(DMat3::IDENTITY, 1e-9) && frame.determinant() > 0.0;
        rigid && frame.x_axis.y.abs() < 1e-9 && frame.y_axis.y > 0.0
    }

    #[test]
    fn orbits_keep_distance_target_and_horizon() {
        let mut n = navigation();
        let (target, distance) = (n.target(), n.distance);
        for i in 0..1000 {
            n.orbit(DVec2::new((f64::from(i) * 0.7).sin(), (f64::from(i) * 1.3).cos()) * 0.4);
            assert!(n.target().abs_diff_eq(target, 1e-6) && is_upright(&n.camera()), "after {i}: {:?}", n.camera());
            assert!((n.eye().distance(target) - distance).abs() < 1e-6);
        }
        n.orbit(DVec2::new(0.0, 50.0));
        assert!(is_upright(&n.camera()) && n.forward().y < -0.999, "from above: {:?}", n.forward());
    }

    #[test]
    fn a_drag_to_the_right_shows_the_left_side() {
        let mut n = navigation();
        let before = n.eye();
        n.orbit(DVec2::new(0.05, 0.0));
        let right = n.camera().world_from_camera.matrix3.x_axis;
        assert!((n.eye() - before).dot(right) < 0.0, "the eye goes to the left");
        let mut n = navigation();
        let right = n.camera().world_from_camera.matrix3.x_axis;
        n.pan(DVec2::new(0.1, 0.0));
        assert!((n.eye() - before).dot(right) < 0.0, "the scene follows the pointer");
        let mut n = navigation();
        n.look(DVec2::new(0.05, 0.0));
        assert!(n.forward().dot(right) > 0.0 && n.eye() == before, "the eye looks where the pointer goes");
    }

    #[test]
    fn wheels_go_back_and_forth() {
        let mut n = navigation();
        let (eye, target) = (n.eye(), n.target());
        n.zoom(3.0);
        assert!(n.eye().distance(target) < eye.distance(target) && n.target().abs_diff_eq(target, 1e-9));
        n.zoom(-3.0);
        assert!(n.eye().abs_diff_eq(eye, 1e-9));
        (0..500).for_each(|_| n.zoom(5.0));
        assert!(n.eye().is_finite() && n.eye().distance(n.target()) > 0.0);
    }

    #[test]
    fn what_fits_is_seen_and_can_be_returned_to() {
        let mut n = navigation();
        let home = n.eye();
        n.fly(DVec3::new(5.0, -2.0, 9.0));
        for aspect in [0.4, 1.0, 2.5] {
            n.fit(aspect);
            let to_camera = n.camera().world_from_camera.inverse();
            for corner in 0..8 {
                let pick = |bit: usize, axis: usize| [n.bounds.min, n.bounds.max][corner >> bit & 1][axis];
                let p = to_camera.transform_point3(DVec3::new(pick(0, 0), pick(1, 1), pick(2, 2)));
                let tangent = 0.35_f64.tan();
                assert!(p.z < 0.0 && (p.y / -p.z).abs() < tangent && (p.x / -p.z).abs() < tangent * aspect, "{p}");
            }
        }
        let fitted = n.view();
        n.reset();
        assert_eq!(n.eye(), home);
        n.return_to(fitted.clone());
        assert!(n.view() == fitted && n.moved());
    }

    #[test]
    fn sides_are_those_of_drawings() {
        for (side, name) in ViewSide::ALL {
            let mut n = navigation();
            n.look_from(side, 1.5);
            let towards = (n.eye() - n.bounds.center()).normalize();
            assert!(towards.dot(side.direction()) > 0.999_99 && n.words().is_some(), "{name}: {towards}");
            assert!(n.least_aspect() == 1.5 && is_upright(&n.camera()), "{name}");
        }
    }

    #[test]
    fn a_point_in_focus_is_in_the_middle() {
        let mut n = navigation();
        let at = DVec3::new(1.0, 0.5, -0.3);
        let before = n.eye().distance(at);
        n.focus(at);
        assert!(n.target().abs_diff_eq(at, 1e-9) && (n.eye().distance(at) - 0.5 * before).abs() < 1e-9);
    }

    #[test]
    fn cameras_of_the_file_go_with_its_time_until_they_are_moved() {
        let mut n = navigation();
        let at = |x: f64| Camera { world_from_camera: DAffine3::from_translation(DVec3::X * x), ..n.home.clone() };
        let (first, second, third) = (at(1.0), at(2.0), at(3.0));
        n.moment(first.clone(), None);
        assert!(n.camera() == first && !n.moved());
        n.stay(second.clone(), None, n.bounds, None);
        assert!(n.camera() == second && !n.moved(), "a file that is read again");
        n.go_to(first.clone(), Some("a camera".to_owned()));
        n.stay(first.clone(), Some(&third), n.bounds, None);
        assert!(n.camera() == third && n.named() == Some("a camera") && !n.moved(), "a camera of the file stays one");
        n.moment(first.clone(), Some(&second));
        assert!(n.camera() == second);
        n.stay(first.clone(), None, n.bounds, None);
        assert!(n.moved() && n.eye() == DVec3::X * 2.0, "a camera that is gone leaves the view");
        n.reset();
        n.orbit(DVec2::new(0.1, 0.0));
        let turned = n.camera();
        n.moment(second.clone(), None);
        n.stay(second.clone(), None, n.bounds, None);
        assert!(n.camera() == turned && n.moved());
        n.reset();
        assert!(n.camera() == second);
        n.stay(third, None, n.bounds, Some(1.5));
        assert!(n.moved() && n.eye() == DVec3::X * 2.0, "the file lost its camera");
    }

    #[test]
    fn a_framed_view_keeps_the_sides_that_it_was_computed_for() {
        let mut n = navigation();
        assert_eq!(n.least_aspect(), MADE_FOR, "a camera of the file");
        n.fit(0.8);
        assert_eq!(n.least_aspect(), 0.8);
        n.reset();
        assert_eq!(n.least_aspect(), MADE_FOR);
        let mut n = Navigation::new(n.home, n.bounds, Some(1.2));
        assert_eq!(n.least_aspect(), 1.2);
        n.fit(0.8);
        n.reset();
        assert_eq!(n.least_aspect(), 1.2, "the initial camera again");
    }

    #[test]
    fn a_rolled_camera_keeps_its_roll() {
        let below = DVec3::new(1.0, -2.0, 0.0);
        let tilted = DVec3::new(0.3, 0.8, -0.2);
        for (target, up) in [(DVec3::ZERO, tilted), (DVec3::ZERO, DVec3::NEG_Y), (below, DVec3::Z)] {
            let home = Camera::looking_at(DVec3::new(1.0, 2.0, 0.0), target, up, 0.7).unwrap();
            let mut n = Navigation::new(home, navigation().bounds, None);
            n.zoom(1.0);
            let (camera, words) = n.words().unwrap();
            let is_same = camera.world_from_camera.abs_diff_eq(n.view.world_from_camera, 1e-5);
            assert!(is_same && words.contains(" --up "), "{words}");
            n.focus(target);
            let frame = n.view.world_from_camera.matrix3;
            assert!(frame.y_axis.abs_diff_eq(camera.world_from_camera.matrix3.y_axis, 1e-5), "{words}: {frame}");
        }
    }

    #[test]
    fn words_give_the_same_camera() {
        let mut n = navigation();
        assert!(n.words().is_none() && !n.moved());
        n.orbit(DVec2::new(0.123, 0.0777));
        n.zoom(1.5);
        let (camera, words) = n.words().unwrap();
        assert!(camera.world_from_camera.abs_diff_eq(n.view.world_from_camera, 1e-5), "{words}");
        assert!(!words.contains("--up"), "{words}");
        assert_eq!(n.camera().world_from_camera, camera.world_from_camera);
        let numbers: Vec<f64> = words.split([' ', ',']).filter_map(|word| word.parse().ok()).collect();
        let again = Camera::looking_at(
            DVec3::from_slice(&numbers[..3]),
            DVec3::from_slice(&numbers[3..6]),
            DVec3::Y,
            numbers[6].to_radians(),
        );
        assert_eq!(again.unwrap().world_from_camera, camera.world_from_camera);
    }
}
