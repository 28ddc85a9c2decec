//! Materials: the glTF 2.0 metallic-roughness model with its extensions; OBJ/MTL is converted to the same fields.
//!
//! Read glTF 2.0 section 3.9 and appendix B, and the KHR_materials_* extensions named at the fields.
//! Factors are linear Rec. 709, and a texture multiplies its factor.

use std::sync::Arc;

use glam::Affine2;

use super::SigmaGrid;
use super::lobe::{self, LOBES, Lobe, LobeOf};
use etalon_optics::spectra::{Dispersion, Emission, Spectrum};

/// A surface description, with the factors and textures of all supported extensions.
#[derive(Debug, Clone)]
pub struct Material {
    /// Name from the file.
    pub name: String,
    /// Base colour and opacity.
    pub base_color: [f32; 4],
    /// Base colour and opacity texture (sRGB, alpha linear).
    pub base_color_texture: Option<TextureRef>,
    /// 0 dielectric … 1 metal.
    pub metallic: f32,
    /// Perceptual roughness; α = roughness².
    pub roughness: f32,
    /// Roughness in G, metallic in B (linear).
    pub metallic_roughness_texture: Option<TextureRef>,
    /// Tangent-space normals (linear).
    pub normal_texture: Option<TextureRef>,
    /// Scale of the normal texture's x and y.
    pub normal_scale: f32,
    /// Ambient occlusion in R (linear).
    pub occlusion_texture: Option<TextureRef>,
    /// Strength of the occlusion, 0 … 1.
    pub occlusion_strength: f32,
    /// Emitted radiance (emissive factor times strength), W/(m² sr) per channel.
    pub emissive: [f32; 3],
    /// Emissive texture (sRGB).
    pub emissive_texture: Option<TextureRef>,
    /// How alpha is used.
    pub alpha_mode: AlphaMode,
    /// Back faces are drawn, with the normal turned to the viewer.
    pub double_sided: bool,
    /// The base colour is the radiance, without lighting (KHR_materials_unlit).
    pub unlit: bool,
    /// Index of refraction n (KHR_materials_ior); 1.5 by default.
    pub ior: f32,
    /// Complex index [n, κ] of the metallic part as a conductor, red first, if known; `base_color` is then its
    /// reflectance at normal incidence. `None` for transmissive materials.
    pub conductor: Option<[[f32; 2]; 3]>,
    /// Strength of the dielectric specular reflection (KHR_materials_specular).
    pub specular: f32,
    /// Specular strength in A (linear).
    pub specular_texture: Option<TextureRef>,
    /// Colour of F0 for dielectrics (KHR_materials_specular).
    pub specular_color: [f32; 3],
    /// Colour of F0 (sRGB).
    pub specular_color_texture: Option<TextureRef>,
    /// Fraction of the non-reflected light that is transmitted (KHR_materials_transmission).
    pub transmission: f32,
    /// Transmission in R (linear).
    pub transmission_texture: Option<TextureRef>,
    /// Thickness in metres of object space below the surface (KHR_materials_volume); 0 is a thin-walled surface.
    pub thickness: f32,
    /// Thickness in G (linear).
    pub thickness_texture: Option<TextureRef>,
    /// Distance in metres after which white light has the colour `attenuation_color`; infinite for clear media.
    pub attenuation_distance: f32,
    /// Transmittance over `attenuation_distance`, linear Rec. 709.
    pub attenuation_color: [f32; 3],
    /// Heterogeneous absorption inside the solid, added to that of `attenuation_distance` (`extras.etalon.sigma`).
    pub sigma: Option<Arc<SigmaGrid>>,
    /// Strength of a clear coat of n = 1.5 (KHR_materials_clearcoat).
    pub clearcoat: f32,
    /// Clear-coat strength in R (linear).
    pub clearcoat_texture: Option<TextureRef>,
    /// Perceptual roughness of the coat.
    pub clearcoat_roughness: f32,
    /// Coat roughness in G (linear).
    pub clearcoat_roughness_texture: Option<TextureRef>,
    /// Tangent-space normals of the coat.
    pub clearcoat_normal_texture: Option<TextureRef>,
    /// Lobes of extensions over the base layer, in the order of [`LOBES`].
    pub lobes: [LobeOf; lobe::COUNT],
    /// Priority among overlapping transmissive solids (nested dielectrics): the medium with the highest priority fills
    /// the overlap, and on a tie the medium entered last (`extras.etalon.priority`).
    pub priority: i32,
    /// Dispersion: n by wavelength (KHR_materials_dispersion, `extras.etalon`). `ior` is n at the Fraunhofer d line.
    pub dispersion: Dispersion,
    /// Reflectance of the base by wavelength; `base_color` is its colour. Only without a base colour texture.
    pub reflectance: Option<Spectrum>,
    /// Emitted radiance by wavelength; `emissive` is its colour. Only without an emissive texture.
    pub emission: Option<Emission>,
    /// n and κ of the metallic part by wavelength, in addition to `conductor`.
    pub conductor_spectra: Option<[Spectrum; 2]>,
    /// The file gives k_d, k_s and shininess (`extras.etalon`). They are stored as the base colour π k_d, the F0 2π
    /// k_s/(shine + 2) and the roughness (2/(shine + 2))^¼. The Phong rungs of the knob `brdf` evaluate lecture B5 and
    /// B6 as written.
    pub phong: bool,
}

impl Material {
    /// Whether κ is well above 0 in all three channels, by the same test as `is_metallic` of shaders/lib/fresnel.glsl.
    #[must_use]
    pub fn is_metallic(&self) -> bool {
        self.conductor.iter().flatten().all(|&[n, kappa]| kappa > n.max(0.5))
    }

    /// All texture slots with their shader names (`NAME_page` in shaders/lib/texels.glsl) and the meaning of their
    /// texels.
    pub fn textures(&self) -> impl Iterator<Item = (&'static str, Meaning, Option<TextureRef>)> {
        use Meaning::{Color, Data};
        let own = [
            ("base", Color, self.base_color_texture),
            ("metallic_roughness", Data, self.metallic_roughness_texture),
            ("normal", Data, self.normal_texture),
            ("occlusion", Data, self.occlusion_texture),
            ("emissive", Color, self.emissive_texture),
            ("specular", Data, self.specular_texture),
            ("specular_color", Color, self.specular_color_texture),
            ("transmission", Data, self.transmission_texture),
            ("thickness", Data, self.thickness_texture),
            ("clearcoat", Data, self.clearcoat_texture),
            ("clearcoat_roughness", Data, self.clearcoat_roughness_texture),
            ("clearcoat_normal", Data, self.clearcoat_normal_texture),
        ];
        own.into_iter().chain(self.lobes().flat_map(|(lobe, of)| {
            lobe.textures.iter().zip(of.textures).map(|(&(_, name, meaning), texture)| (name, meaning, texture))
        }))
    }

    /// All lobes over the base, including those with factor 0.
    pub fn lobes(&self) -> impl Iterator<Item = (&'static Lobe, &LobeOf)> {
        LOBES.iter().copied().zip(&self.lobes)
    }

    /// Whether a lobe has a direction in the surface, so that meshes of the material need tangents.
    #[must_use]
    pub fn has_direction(&self) -> bool {
        self.lobes().any(|(lobe, of)| lobe.has_direction && lobe.is_on(of))
    }

    /// All texture slots, mutable.
    pub fn textures_mut(&mut self) -> impl Iterator<Item = &mut Option<TextureRef>> {
        let own = [
            &mut self.base_color_texture,
            &mut self.metallic_roughness_texture,
            &mut self.normal_texture,
            &mut self.occlusion_texture,
            &mut self.emissive_texture,
            &mut self.specular_texture,
            &mut self.specular_color_texture,
            &mut self.transmission_texture,
            &mut self.thickness_texture,
            &mut self.clearcoat_texture,
            &mut self.clearcoat_roughness_texture,
            &mut self.clearcoat_normal_texture,
        ];
        own.into_iter().chain(self.lobes.iter_mut().flat_map(|of| &mut of.textures))
    }

    /// Whether the medium absorbs.
    #[must_use]
    pub fn absorbs(&self) -> bool {
        (self.attenuation_distance.is_finite() && self.attenuation_color.iter().any(|&c| c < 1.0))
            || self.marched_sigma().is_some()
    }

    /// Whether the medium disperses: wavelengths refract into different directions.
    #[must_use]
    pub fn disperses(&self) -> bool {
        self.transmission > 0.0 && self.dispersion.disperses(f64::from(self.ior))
    }

    /// n and κ of the metallic part at a wavelength in nm.
    #[must_use]
    pub fn complex_index(&self, nm: f64) -> [f64; 2] {
        match (&self.conductor_spectra, &self.conductor) {
            (Some(spectra), _) => spectra.each_ref().map(|spectrum| spectrum.at(nm)),
            // Without spectra: the index at the nearest of the three wavelengths of lecture C1.
            (None, Some([red, green, blue])) => {
                let lamp = if nm > 585.0 {
                    red
                } else if nm > 485.0 {
                    green
                } else {
                    blue
                };
                lamp.map(f64::from)
            }
            (None, None) => [self.dispersion.index(f64::from(self.ior), nm), 0.0],
        }
    }

    /// The grid of σ of a transmissive solid, unless it is 0 everywhere; paths march through it.
    #[must_use]
    pub fn marched_sigma(&self) -> Option<&SigmaGrid> {
        self.sigma.as_deref().filter(|grid| self.transmission > 0.0 && self.thickness > 0.0 && !grid.is_zero())
    }
}

/// Alpha modes of glTF 2.0 section 3.9.4.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum AlphaMode {
    /// Alpha is ignored.
    #[default]
    Opaque,
    /// Alpha test: fragments below the cutoff are discarded, the others are opaque.
    Mask(
        /// Alpha cutoff.
        f32,
    ),
    /// Alpha is coverage, composited over the background.
    Blend,
}

/// Encoding of an image's bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Meaning {
    /// sRGB-encoded colour, linear alpha.
    Color,
    /// Linear numbers.
    Data,
}

/// A reference to an image with coordinates and sampling.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TextureRef {
    /// Index into [`super::Scene::images`].
    pub image: usize,
    /// Texture-coordinate set, 0 or 1.
    pub uv_set: u32,
    /// KHR_texture_transform, applied to the coordinate before sampling.
    pub uv_transform: Affine2,
    /// Filters and wrap modes.
    pub sampler: Sampler,
}

/// A glTF sampler. Minification is always trilinear with mip levels unless the file asks for nearest.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Sampler {
    /// Along u.
    pub wrap_u: Wrap,
    /// Along v.
    pub wrap_v: Wrap,
    /// Magnification takes the nearest texel.
    pub mag_nearest: bool,
    /// Minification takes the nearest texel of a level.
    pub min_nearest: bool,
    /// Mip levels are used.
    pub mips: bool,
}

/// Addressing of texture coordinates outside 0 … 1.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Default)]
pub enum Wrap {
    /// The image repeats.
    #[default]
    Repeat,
    /// The image repeats mirrored.
    Mirror,
    /// The edge texel continues.
    Clamp,
}

impl Default for Sampler {
    fn default() -> Self {
        Self { wrap_u: Wrap::Repeat, wrap_v: Wrap::Repeat, mag_nearest: false, min_nearest: false, mips: true }
    }
}

impl Default for Material {
    /// glTF's default material, the default values of section 3.9.2: white, metallic 1, roughness 1.
    fn default() -> Self {
        Self {
            name: "default".to_owned(),
            base_color: [1.0; 4],
            base_color_texture: None,
            metallic: 1.0,
            roughness: 1.0,
            metallic_roughness_texture: None,
            normal_texture: None,
            normal_scale: 1.0,
            occlusion_texture: None,
            occlusion_strength: 1.0,
            emissive: [0.0; 3],
            emissive_texture: None,
            alpha_mode: AlphaMode::Opaque,
            double_sided: false,
            unlit: false,
            ior: 1.5,
            conductor: None,
            specular: 1.0,
            specular_texture: None,
            specular_color: [1.0; 3],
            specular_color_texture: None,
            transmission: 0.0,
            transmission_texture: None,
            thickness: 0.0,
            thickness_texture: None,
            attenuation_distance: f32::INFINITY,
            attenuation_color: [1.0; 3],
            sigma: None,
            clearcoat: 0.0,
            clearcoat_texture: None,
            clearcoat_roughness: 0.0,
            clearcoat_roughness_texture: None,
            clearcoat_normal_texture: None,
            lobes: [LobeOf::default(); lobe::COUNT],
            priority: 0,
            dispersion: Dispersion::None,
            reflectance: None,
            emission: None,
            conductor_spectra: None,
            phong: false,
        }
    }
}
