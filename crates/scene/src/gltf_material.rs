//! glTF materials, textures and images, converted to [`Material`] and [`Image`].
//!
//! Read glTF 2.0 sections 3.8 and 3.9, and the KHR_materials_* extensions.

use std::collections::HashMap;

use anyhow::{Context, Result, ensure};
use glam::{Affine2, Vec2};
use gltf::json::{
    self,
    extensions::texture::TextureTransform,
    material::AlphaMode as JsonAlphaMode,
    texture::{MagFilter, MinFilter, WrappingMode},
    validation::Checked,
};
use rayon::prelude::*;
use serde::Deserialize;
use serde_json::{Map, Value};

use super::substance::INFINITE_IOR;
use super::{
    AlphaMode, Image, Material, MissingImages, Sampler, TextureRef, Wrap,
    document::Document,
    gltf_extras,
    lobe::{Factor, LOBES, Lobe, LobeOf},
    pictures::{self, ImageUse},
    uri::short_uri,
};
use etalon_optics::spectra;

/// Materials of the whole file, and the file's images that their textures use.
pub(crate) struct Materials {
    pub(crate) materials: Vec<Material>,
    /// Source of each image, by [`TextureRef::image`], until [`Materials::decode`].
    sources: Vec<ImageSource>,
}

/// Where the texels of an image come from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(crate) struct ImageSource {
    /// Index of the image in the file.
    file: usize,
    /// The bits of a glossiness factor: the image is then the roughness 1 − factor · alpha, in G.
    glossiness: Option<u32>,
}

impl ImageSource {
    fn decode(self, document: &Document<'_>) -> Result<Image> {
        let mut image = with_bytes(document, self.file, pictures::decode)?;
        if let Some(factor) = self.glossiness.map(f32::from_bits) {
            let roughness = |alpha: u8| (255.0 - factor * f32::from(alpha)).round() as u8;
            image.rgba = image.rgba.as_chunks::<4>().0.iter().flat_map(|t| [0, roughness(t[3]), 0, 255]).collect();
        }
        Ok(image)
    }
}

/// KHR_materials_clearcoat, which the `gltf` crate does not know.
#[derive(Deserialize, Default)]
#[serde(rename_all = "camelCase", default)]
struct Clearcoat {
    clearcoat_factor: f32,
    clearcoat_texture: Option<json::texture::Info>,
    clearcoat_roughness_factor: f32,
    clearcoat_roughness_texture: Option<json::texture::Info>,
    clearcoat_normal_texture: Option<json::material::NormalTexture>,
}

/// KHR_materials_pbrSpecularGlossiness, which is archived.
#[derive(Deserialize)]
#[serde(rename_all = "camelCase", default)]
struct SpecularGlossiness {
    diffuse_factor: [f32; 4],
    diffuse_texture: Option<json::texture::Info>,
    specular_factor: [f32; 3],
    glossiness_factor: f32,
    specular_glossiness_texture: Option<json::texture::Info>,
}

impl Default for SpecularGlossiness {
    fn default() -> Self {
        Self {
            diffuse_factor: [1.0; 4],
            diffuse_texture: None,
            specular_factor: [1.0; 3],
            glossiness_factor: 1.0,
            specular_glossiness_texture: None,
        }
    }
}

/// KHR_materials_dispersion, which the `gltf` crate does not know.
#[derive(Deserialize, Default)]
#[serde(default)]
struct KhrDispersion {
    dispersion: f32,
}

/// An extension that names the picture of a texture in another format.
#[derive(Deserialize)]
struct OtherSource {
    source: usize,
}

/// Such extensions, the preferred one first.
const OTHER_SOURCES: [&str; 2] = ["KHR_texture_basisu", "EXT_texture_webp"];

/// Decoded images by their source.
pub(crate) type KnownImages = HashMap<ImageSource, Image>;

struct MaterialReader<'d, 'b, 'w> {
    document: &'d Document<'b>,
    warnings: &'w mut Vec<String>,
    /// Source of each scene image.
    used_images: Vec<ImageSource>,
    /// Prefix of messages: `material 3 "Glass"`.
    place: String,
}

/// Reads every material of the file.
pub(crate) fn read(document: &Document<'_>, warnings: &mut Vec<String>) -> Result<Materials> {
    let root = &document.root;
    let mut reader = MaterialReader { document, warnings, used_images: Vec::new(), place: String::new() };
    let mut materials = Vec::with_capacity(root.materials.len() + 1);
    for (index, json) in root.materials.iter().enumerate() {
        reader.place = match &json.name {
            Some(name) => format!("material {index} \"{name}\""),
            None => format!("material {index}"),
        };
        materials.push(reader.material(index, json).with_context(|| reader.place.clone())?);
    }
    Ok(Materials { materials, sources: reader.used_images })
}

impl Materials {
    /// Decodes, in parallel, the images that the materials still use and that are not in `known`, a cache by source.
    /// Reads the headers of all other images, so that a broken file is found either way.
    pub(crate) fn decode(
        &mut self,
        document: &Document<'_>,
        known: &mut KnownImages,
        missing: MissingImages,
        warnings: &mut Vec<String>,
    ) -> Result<Vec<Image>> {
        let first = known.is_empty();
        let mut places = vec![None; self.sources.len()];
        let mut wanted = Vec::new();
        for texture in self.materials.iter_mut().flat_map(Material::textures_mut).flatten() {
            texture.image = *places[texture.image].get_or_insert_with(|| {
                wanted.push(self.sources[texture.image]);
                wanted.len() - 1
            });
        }
        for i in (0..document.root.images.len()).filter(|&i| first && wanted.iter().all(|source| source.file != i)) {
            let name = image_name(document, i);
            match (with_bytes(document, i, |_, bytes| pictures::probe(bytes)), missing) {
                (Err(error), MissingImages::Checker) => {
                    warnings.push(format!("{name} cannot be read ({error:#}); nothing that is drawn needs it"));
                }
                (read, _) => read.context(name)?,
            }
        }
        let unknown: Vec<(usize, ImageSource)> =
            wanted.iter().copied().enumerate().filter(|(_, source)| !known.contains_key(source)).collect();
        let decoded: Vec<Result<Image>> = unknown.par_iter().map(|(_, source)| source.decode(document)).collect();
        for ((image, source), read) in unknown.into_iter().zip(decoded) {
            let of = ImageUse::of(&self.materials, image);
            known.insert(source, missing.replace(read, &image_name(document, source.file), of, warnings)?);
        }
        Ok(wanted.iter().map(|source| known[source].clone()).collect())
    }
}

/// Name of image `index`: that of its file, or the one that the JSON gives it.
fn bare_name(document: &Document<'_>, index: usize) -> String {
    match document.root.images.get(index).map(|json| (&json.name, &json.uri)) {
        Some((_, Some(uri))) if !uri.starts_with("data:") => short_uri(uri),
        Some((Some(name), _)) => name.clone(),
        _ => format!("image {index}"),
    }
}

/// Image `index` in messages.
fn image_name(document: &Document<'_>, index: usize) -> String {
    format!("image {index} \"{}\"", bare_name(document, index))
}

/// Passes the name and the encoded bytes of image `index` to `then`; the caller names the image in its error.
fn with_bytes<T>(document: &Document<'_>, index: usize, then: impl FnOnce(String, &[u8]) -> Result<T>) -> Result<T> {
    let json = document.root.images.get(index).context("it does not exist")?;
    let name = bare_name(document, index);
    match (&json.uri, json.buffer_view) {
        (Some(uri), _) => document.resolve(uri).and_then(|bytes| then(name, &bytes)),
        (None, Some(view)) => document.view(view.value()).and_then(|(bytes, _)| then(name, bytes)),
        (None, None) => Err(anyhow::anyhow!("it has neither a URI nor a buffer view")),
    }
}

fn parse<'v, T: Deserialize<'v>>(others: &'v Map<String, Value>, name: &str) -> Result<Option<T>> {
    others.get(name).map(|v| T::deserialize(v).with_context(|| format!("the extension {name}"))).transpose()
}

impl MaterialReader<'_, '_, '_> {
    fn warn(&mut self, what: &str) {
        self.warnings.push(format!("{}: {what}", self.place));
    }

    /// Clamps a factor to 0 … 1 (glTF 2.0) with a warning.
    fn unit(&mut self, value: f32, name: &str) -> f32 {
        self.within(value, [0.0, 1.0], name)
    }

    /// Clamps a factor to its range with a warning.
    fn within(&mut self, value: f32, [least, most]: [f32; 2], name: &str) -> f32 {
        let clamped = value.clamp(least, most);
        if clamped != value {
            self.warn(&format!("{name} {value} lies outside {least} … {most} and is clamped"));
        }
        clamped
    }

    /// Clamps a factor to non-negative values (glTF 2.0) with a warning.
    fn positive(&mut self, value: f32, name: &str) -> f32 {
        let clamped = value.clamp(0.0, f32::MAX);
        if clamped != value {
            self.warn(&format!("{name} {value} is negative or infinite and is clamped"));
        }
        clamped
    }

    fn material(&mut self, index: usize, json: &json::Material) -> Result<Material> {
        let pbr = &json.pbr_metallic_roughness;
        let mut m = Material {
            name: json.name.clone().unwrap_or_else(|| format!("material {index}")),
            base_color: pbr.base_color_factor.0.map(|x| self.unit(x, "the base colour factor")),
            base_color_texture: self.texture(pbr.base_color_texture.as_ref())?,
            metallic: self.unit(pbr.metallic_factor.0, "the metallic factor"),
            roughness: self.unit(pbr.roughness_factor.0, "the roughness factor"),
            metallic_roughness_texture: self.texture(pbr.metallic_roughness_texture.as_ref())?,
            emissive: json.emissive_factor.0.map(|x| self.positive(x, "the emissive factor")),
            emissive_texture: self.texture(json.emissive_texture.as_ref())?,
            double_sided: json.double_sided,
            ..Material::default()
        };
        m.alpha_mode = match json.alpha_mode {
            Checked::Valid(JsonAlphaMode::Mask) => {
                AlphaMode::Mask(self.positive(json.alpha_cutoff.unwrap_or_default().0, "the alpha cutoff"))
            }
            Checked::Valid(JsonAlphaMode::Blend) => AlphaMode::Blend,
            _ => AlphaMode::Opaque,
        };
        if let Some(normal) = &json.normal_texture {
            m.normal_texture = self.normal_texture(normal)?;
            m.normal_scale = normal.scale;
        }
        if let Some(occlusion) = &json.occlusion_texture {
            let transform = occlusion.extensions.as_ref().map(|e| parse(&e.others, "KHR_texture_transform"));
            let transform: Option<TextureTransform> = transform.transpose()?.flatten();
            m.occlusion_texture = self.reference(occlusion.index.value(), occlusion.tex_coord, transform.as_ref())?;
            m.occlusion_strength = self.unit(occlusion.strength.0, "the occlusion strength");
        }
        if let Some(extensions) = &json.extensions {
            self.extensions(&mut m, extensions)?;
        }
        let file_ior = json.extensions.as_ref().and_then(|e| e.ior.as_ref()).map(|ior| ior.ior.0);
        for warning in gltf_extras::apply(&json.extras, file_ior, &mut m)? {
            self.warn(&warning);
        }
        if m.ior < 1.0 {
            self.warn(&format!("the index of refraction {} is below 1, that of a vacuum", m.ior));
        }
        Ok(m)
    }

    fn extensions(&mut self, m: &mut Material, json: &json::extensions::material::Material) -> Result<()> {
        m.unlit = json.unlit.is_some();
        if json.others.contains_key("KHR_materials_volume_scatter") {
            self.warn("scattering inside the volume (KHR_materials_volume_scatter) is not drawn; its absorption is");
        }
        if let Some(strength) = &json.emissive_strength {
            let strength = self.positive(strength.emissive_strength.0, "the emissive strength");
            m.emissive = m.emissive.map(|e| (e * strength).min(f32::MAX));
        }
        if let Some(specular) = &json.specular {
            m.specular = self.unit(specular.specular_factor.0, "the specular factor");
            m.specular_texture = self.texture(specular.specular_texture.as_ref())?;
            m.specular_color = specular.specular_color_factor.0.map(|x| self.positive(x, "the specular colour"));
            m.specular_color_texture = self.texture(specular.specular_color_texture.as_ref())?;
        }
        if let Some(transmission) = &json.transmission {
            m.transmission = self.unit(transmission.transmission_factor.0, "the transmission factor");
            m.transmission_texture = self.texture(transmission.transmission_texture.as_ref())?;
        }
        if let Some(ior) = &json.ior {
            m.ior = self.ior(ior.ior.0, m.transmission)?;
        }
        if let Some(volume) = &json.volume {
            m.thickness = self.positive(volume.thickness_factor.0, "the thickness");
            m.thickness_texture = self.texture(volume.thickness_texture.as_ref())?;
            m.attenuation_distance = volume.attenuation_distance.0;
            if m.attenuation_distance <= 0.0 {
                self.warn("the attenuation distance is not positive; the medium is read as clear");
                m.attenuation_distance = f32::INFINITY;
            }
            m.attenuation_color = volume.attenuation_color.0.map(|x| self.unit(x, "the attenuation colour"));
        }
        if let Some(coat) = parse::<Clearcoat>(&json.others, "KHR_materials_clearcoat")? {
            m.clearcoat = self.unit(coat.clearcoat_factor, "the clear-coat factor");
            m.clearcoat_texture = self.texture(coat.clearcoat_texture.as_ref())?;
            m.clearcoat_roughness = self.unit(coat.clearcoat_roughness_factor, "the clear-coat roughness");
            m.clearcoat_roughness_texture = self.texture(coat.clearcoat_roughness_texture.as_ref())?;
            if let Some(normal) = &coat.clearcoat_normal_texture {
                m.clearcoat_normal_texture = self.normal_texture(normal)?;
                if normal.scale != 1.0 {
                    self.warn("the scale of the clear-coat normal texture is ignored");
                }
            }
        }
        for (lobe, of) in LOBES.iter().zip(&mut m.lobes) {
            if let Some(value) = json.others.get(lobe.extension) {
                *of = self.lobe(lobe, value).with_context(|| format!("the extension {}", lobe.extension))?;
            }
        }
        // After the index and the specular reflection, in whose place it stands.
        if let Some(glossy) = parse::<SpecularGlossiness>(&json.others, "KHR_materials_pbrSpecularGlossiness")? {
            self.specular_glossiness(m, &glossy)?;
        }
        if let Some(dispersion) = parse::<KhrDispersion>(&json.others, "KHR_materials_dispersion")? {
            let abbe = f64::from(self.positive(dispersion.dispersion, "the dispersion"));
            m.dispersion = if abbe > 0.0 { spectra::Dispersion::Abbe(abbe) } else { spectra::Dispersion::None };
        }
        Ok(())
    }

    /// A material by specular colour and glossiness, as a dielectric of n = 1.5 whose F0 has that colour
    /// (KHR_materials_specular allows any): the curve of Fresnel's equations stays that of a dielectric. The diffuse
    /// part gets 1 − F at the half vector, where the extension gives it 1 − F0 for all angles.
    fn specular_glossiness(&mut self, m: &mut Material, json: &SpecularGlossiness) -> Result<()> {
        m.base_color = json.diffuse_factor.map(|x| self.unit(x, "the diffuse factor"));
        m.base_color_texture = self.texture(json.diffuse_texture.as_ref())?;
        m.metallic = 0.0;
        (m.ior, m.specular, m.specular_texture) = (1.5, 1.0, None);
        let f0 = ((m.ior - 1.0) / (m.ior + 1.0)).powi(2);
        m.specular_color = json.specular_factor.map(|x| self.unit(x, "the specular factor") / f0);
        m.specular_color_texture = self.texture(json.specular_glossiness_texture.as_ref())?;
        let glossiness = self.unit(json.glossiness_factor, "the glossiness factor");
        m.roughness = 1.0 - glossiness;
        m.metallic_roughness_texture = m.specular_color_texture.map(|texture| {
            m.roughness = 1.0;
            let file = self.used_images[texture.image].file;
            TextureRef { image: self.image(ImageSource { file, glossiness: Some(glossiness.to_bits()) }), ..texture }
        });
        Ok(())
    }

    /// Index of the scene image with this source.
    fn image(&mut self, source: ImageSource) -> usize {
        let place = self.used_images.iter().position(|used| *used == source);
        place.unwrap_or_else(|| {
            self.used_images.push(source);
            self.used_images.len() - 1
        })
    }

    fn lobe(&mut self, lobe: &Lobe, said: &Value) -> Result<LobeOf> {
        let mut of = LobeOf::default();
        let mut factors = of.factors.iter_mut();
        for &Factor { name, count, default, range } in lobe.factors {
            let numbers: Vec<f32> = match said.get(name) {
                None => vec![default; count],
                Some(value) if count == 1 => vec![f32::deserialize(value).context(name)?],
                Some(value) => Vec::deserialize(value).context(name)?,
            };
            ensure!(numbers.len() == count, "{name} has {} numbers, not {count}", numbers.len());
            for (number, factor) in numbers.into_iter().zip(factors.by_ref()) {
                *factor = self.within(number, range, name);
            }
        }
        for (texture, &(name, ..)) in of.textures.iter_mut().zip(lobe.textures) {
            let info = said.get(name).map(|value| json::texture::Info::deserialize(value).context(name));
            *texture = self.texture(info.transpose()?.as_ref())?;
        }
        Ok(of)
    }

    /// Checks the index of KHR_materials_ior, which allows 0 ("infinite": a perfect reflector) and everything from 1
    /// on. Indices between 0 and 1 are accepted, too. A transmissive material needs an index above 0.
    fn ior(&mut self, ior: f32, transmission: f32) -> Result<f32> {
        ensure!(
            ior > 0.0 || transmission == 0.0,
            "n = {ior} in KHR_materials_ior: light that is transmitted ({transmission}) needs an index above 0"
        );
        if ior == 0.0 {
            self.warn(&format!("the index of refraction 0 means infinite and is read as {INFINITE_IOR:e}"));
            return Ok(INFINITE_IOR);
        }
        let possible = if ior > 0.0 { ior.min(INFINITE_IOR) } else { 1.0 };
        if possible != ior {
            self.warn(&format!("the index of refraction {ior} is not possible and is read as {possible}"));
        }
        Ok(possible)
    }

    fn texture(&mut self, info: Option<&json::texture::Info>) -> Result<Option<TextureRef>> {
        let Some(info) = info else { return Ok(None) };
        let transform = info.extensions.as_ref().and_then(|e| e.texture_transform.as_ref());
        self.reference(info.index.value(), info.tex_coord, transform)
    }

    fn normal_texture(&mut self, normal: &json::material::NormalTexture) -> Result<Option<TextureRef>> {
        let transform = normal.extensions.as_ref().map(|e| parse(&e.others, "KHR_texture_transform"));
        let transform: Option<TextureTransform> = transform.transpose()?.flatten();
        self.reference(normal.index.value(), normal.tex_coord, transform.as_ref())
    }

    fn reference(
        &mut self,
        texture: usize,
        tex_coord: u32,
        transform: Option<&TextureTransform>,
    ) -> Result<Option<TextureRef>> {
        let root = &self.document.root;
        let json = root
            .textures
            .get(texture)
            .with_context(|| format!("texture {texture} does not exist; the file has {}", root.textures.len()))?;
        let others = json.extensions.as_ref().map(|extensions| &extensions.others);
        let mut other = None;
        for name in OTHER_SOURCES {
            other = match (other, others) {
                (None, Some(others)) => parse::<OtherSource>(others, name)?,
                (found, _) => found,
            };
        }
        let source = match other {
            Some(other) => other.source,
            // The crate's placeholder for a texture without a source.
            None if json.source.value() == u32::MAX as usize => {
                self.warn(&format!("texture {texture} has no picture that can be read, and is left out"));
                return Ok(None);
            }
            None => json.source.value(),
        };
        let count = root.images.len();
        ensure!(source < count, "texture {texture} names image {source}, but the file has {count}");
        let image = self.image(ImageSource { file: source, glossiness: None });
        let mut uv_set = transform.and_then(|t| t.tex_coord).unwrap_or(tex_coord);
        if uv_set > 1 {
            self.warn(&format!(
                "texture {texture} uses texture-coordinate set {uv_set}; only 0 and 1 are read, 0 is taken"
            ));
            uv_set = 0;
        }
        let uv_transform = transform.map_or(Affine2::IDENTITY, |t| {
            // v points down, so a counter-clockwise rotation of the coordinates is a negative angle.
            Affine2::from_scale_angle_translation(Vec2::from(t.scale.0), -t.rotation.0, Vec2::from(t.offset.0))
        });
        ensure!(uv_transform.is_finite(), "the transform of texture {texture} is not finite");
        let sampler = json.sampler.and_then(|s| root.samplers.get(s.value())).map_or_else(Sampler::default, sampler);
        Ok(Some(TextureRef { image, uv_set, uv_transform, sampler }))
    }
}

fn wrap(mode: &Checked<WrappingMode>) -> Wrap {
    match mode {
        Checked::Valid(WrappingMode::ClampToEdge) => Wrap::Clamp,
        Checked::Valid(WrappingMode::MirroredRepeat) => Wrap::Mirror,
        _ => Wrap::Repeat,
    }
}

/// Nearest-texel filters are used as written; all others become trilinear with mip levels.
fn sampler(json: &json::texture::Sampler) -> Sampler {
    let min = json.min_filter.and_then(|f| if let Checked::Valid(f) = f { Some(f) } else { None });
    Sampler {
        wrap_u: wrap(&json.wrap_s),
        wrap_v: wrap(&json.wrap_t),
        mag_nearest: matches!(json.mag_filter, Some(Checked::Valid(MagFilter::Nearest))),
        min_nearest: matches!(
            min,
            Some(MinFilter::Nearest | MinFilter::NearestMipmapNearest | MinFilter::NearestMipmapLinear)
        ),
        mips: min != Some(MinFilter::Nearest),
    }
}
