//! A device under validation, and helpers that render pictures for tests.
//!
//! Core and synchronization validation are on; an error message fails the test that owns the [`Gpu`] when it ends.

use std::sync::{Arc, Once, PoisonError, RwLock, RwLockReadGuard, RwLockWriteGuard};

use etalon::frame::{Rendered, Renderer, Settings};
use etalon::gpu::{Device, DeviceChoice, Severity};
use etalon::image::Picture;
use etalon::plan::{Knobs, Model};
use etalon::scene::environment::Environment;
use etalon::scene::{Camera, Scene};
use etalon::share::AovPixel;
use etalon::upload::view::View;

/// A device with validation, shared by the tests of a program (`crates/vulkan/src/open.rs`): the software device, or
/// the one that the environment variable `ETALON_TEST_DEVICE` names as `--device` does (`gpu`, an index, a name).
pub struct Gpu {
    /// The device.
    pub device: Arc<Device>,
    /// Errors do not fail the test: it checks them itself.
    pub expects_errors: bool,
    /// Guard of shared or exclusive use, until the end of the test.
    _place: Place,
}

enum Place {
    Shared { _guard: RwLockReadGuard<'static, ()> },
    Own { _guard: RwLockWriteGuard<'static, ()> },
}

static PLACES: RwLock<()> = RwLock::new(());

impl Gpu {
    /// Opens the device of the tests ([`choice`]) for shared use; a machine without it fails the test.
    pub fn open() -> Self {
        let place = Place::Shared { _guard: PLACES.read().unwrap_or_else(PoisonError::into_inner) };
        Self::opened(place, Device::open)
    }

    /// The best device, with validation and for exclusive use, where its driver reports what its compiler makes of
    /// pipelines; otherwise `None`. It may draw nothing: Mesa's RADV compiles without a GPU
    /// (docs/decisions/architectures.md).
    pub fn that_tells_compiled() -> Option<Self> {
        let place = Place::Own { _guard: PLACES.write().unwrap_or_else(PoisonError::into_inner) };
        let gpu = Self::opened(place, |_, validate| Device::open(&DeviceChoice::Best, validate));
        gpu.device.tells_compiled().then_some(gpu)
    }

    /// [`Gpu::open`] for exclusive use in this program: for tests that count created objects, or that expect errors.
    pub fn alone() -> Self {
        let place = Place::Own { _guard: PLACES.write().unwrap_or_else(PoisonError::into_inner) };
        Self::opened(place, Device::open)
    }

    /// [`Gpu::open`] for programs with hundreds of pipelines for a few pixels each. lavapipe compiles without LLVM's
    /// optimisations, in 0.6 of the time and to the same bits (compared for `study:etalon` and `study:cornell` with
    /// path tracing). It renders on the thread of its queue, because waking other threads takes longer than rendering
    /// so few pixels (tests/furnace.rs: 43 s instead of 65 s on two cores, where waking took 15 s).
    pub fn hasty() -> Self {
        in_haste();
        Self::open()
    }

    /// [`Gpu::hasty`] for exclusive use, on a device with time-sliced submission as in the viewer.
    pub fn time_sliced() -> Self {
        in_haste();
        let place = Place::Own { _guard: PLACES.write().unwrap_or_else(PoisonError::into_inner) };
        Self::opened(place, Device::open_time_sliced)
    }

    fn opened(place: Place, open: impl FnOnce(&DeviceChoice, bool) -> anyhow::Result<Arc<Device>>) -> Self {
        match open(&choice(), true) {
            Ok(device) => Self { device, expects_errors: false, _place: place },
            Err(error) => panic!("these tests need {} and the Khronos validation layer: {error:#}", choice()),
        }
    }

    /// Validation errors so far.
    pub fn errors(&self) -> Vec<String> {
        let messages = self.device.messages();
        messages.into_iter().filter(|m| m.severity == Severity::Error).map(|m| m.text).collect()
    }

    /// A renderer of a scene.
    pub fn renderer(&self, scene: &Scene, environment: Option<&Environment>, settings: Settings) -> Renderer {
        Renderer::new(&self.device, scene.clone(), environment, settings).expect("a renderer")
    }

    /// The scene-linear picture from the scene's first camera, without an environment.
    pub fn film(&self, scene: &Scene, settings: Settings) -> Picture {
        self.shot(scene, None, settings).1
    }

    /// Renders from the scene's first camera; returns the result and the scene-linear picture.
    pub fn shot(&self, scene: &Scene, environment: Option<&Environment>, settings: Settings) -> (Rendered, Picture) {
        let mut renderer = self.renderer(scene, environment, settings);
        let rendered = renderer.render(&scene.cameras[0], &mut |_| ()).expect("a picture");
        assert_finite(&rendered);
        let film = renderer.film().expect("the film");
        (rendered, film)
    }

    /// Picture, G-buffer and view of one rendering.
    pub fn all(&self, scene: &Scene, camera: &Camera, settings: Settings) -> (Picture, Vec<AovPixel>, View) {
        let mut renderer = self.renderer(scene, None, settings);
        assert_finite(&renderer.render(camera, &mut |_| ()).expect("a picture"));
        let film = renderer.film().expect("the film");
        let (aovs, view) = renderer.aovs(camera).expect("the G-buffer");
        (film, aovs, view)
    }
}

/// Most comparisons do not see NaN, so no picture for them may have any; nor may a path end in it.
#[track_caller]
pub fn assert_finite(rendered: &Rendered) {
    let (counts, work) = (&rendered.counts, &rendered.work);
    let found = (counts.nan, counts.inf, work.not_finite);
    assert_eq!(found, (0, 0, 0), "NaN, infinities and lost paths: {:?}", work.first_not_finite);
}

/// The device of the tests.
#[must_use]
pub fn choice() -> DeviceChoice {
    std::env::var("ETALON_TEST_DEVICE")
        .map_or(DeviceChoice::Cpu, |text| text.parse().unwrap_or_else(|never| match never {}))
}

impl Drop for Gpu {
    fn drop(&mut self) {
        // A second panic during unwinding would hide the first.
        if !std::thread::panicking() && !self.expects_errors {
            let errors = self.errors();
            assert!(errors.is_empty(), "validation: {}", errors.join("\n"));
        }
    }
}

#[allow(unsafe_code, reason = "the driver takes these settings from the environment alone")]
fn in_haste() {
    static SET: Once = Once::new();
    SET.call_once(|| {
        // SAFETY: every test of such a program begins here, and only Rust's start-up code has read the environment
        // before.
        unsafe {
            std::env::set_var("GALLIVM_PERF", "nopt");
            std::env::set_var("LP_NUM_THREADS", "0");
        }
    });
}

/// Settings with one sample per pixel, at the pixel centres.
pub fn settings(size: [u32; 2]) -> Settings {
    Settings { size, knobs: knobs(&["samples=1"]), ..Settings::default() }
}

/// A model with the given rungs.
#[must_use]
pub fn settings_of(model: Model, size: [u32; 2], choices: &[&str]) -> Settings {
    let mut knobs = Knobs::of(model);
    let choices: Vec<String> = choices.iter().map(|&choice| choice.to_owned()).collect();
    knobs.set_all(&choices).expect("rungs");
    Settings { size, knobs, ..Settings::default() }
}

/// The local model without shadows, and with the given rungs.
pub fn knobs(choices: &[&str]) -> Knobs {
    let mut knobs = Knobs::of(Model::Local);
    // Most reference values are without shadows.
    knobs.set("shadows=off").expect("a rung");
    for choice in choices {
        knobs.set(choice).expect("a rung");
    }
    knobs
}

/// The factor on the studio environment that lights a study scene; `None` where its own lights do alone.
#[must_use]
pub fn studio_of(scene: &Scene) -> Option<f32> {
    scene.studio.or(scene.lights.is_empty().then_some(1.0))
}

/// The bits of a picture.
pub fn bits(picture: &Picture) -> Vec<[u32; 4]> {
    picture.rgba.iter().map(|p| p.map(f32::to_bits)).collect()
}

/// Largest |a − b| / scale over the three colours of all pixels; infinite if one is NaN.
pub fn largest_difference(a: &Picture, b: &Picture, scale: f64) -> f64 {
    assert_eq!((a.width, a.height), (b.width, b.height));
    let all = a.rgba.iter().flatten().zip(b.rgba.iter().flatten());
    all.fold(0.0, |most: f64, (a, b)| {
        let difference = (f64::from(*a) - f64::from(*b)).abs() / scale;
        most.max(if difference.is_nan() { f64::INFINITY } else { difference })
    })
}

/// Mean of a channel over a picture, its standard error estimated from the pixels, and the largest value.
pub fn spread(picture: &Picture, channel: usize) -> [f64; 3] {
    let all: Vec<f64> = picture.rgba.iter().map(|pixel| f64::from(pixel[channel])).collect();
    let n = all.len() as f64;
    let mean = all.iter().sum::<f64>() / n;
    let variance = all.iter().map(|x| (x - mean) * (x - mean)).sum::<f64>() / (n - 1.0);
    [mean, (variance / n).sqrt(), all.iter().copied().fold(f64::MIN, f64::max)]
}
