//! Wavefront OBJ with MTL, imported into a [`Scene`]: the file format of Phong materials.
//!
//! Read `docs/scene-input.md` for the conversion of MTL to metallic-roughness materials. Lengths in files are metres.

use std::{
    borrow::Cow,
    collections::{HashMap, HashSet},
    fs,
    hash::{BuildHasherDefault, Hasher},
    path::{Path, PathBuf},
    str::SplitWhitespace,
};

use anyhow::{Context, Result, anyhow, bail, ensure};
use glam::{Affine2, DAffine3, DVec2, DVec3, Vec2, Vec3};
use rayon::prelude::*;

use super::{
    AlphaMode, Image, Instance, LoadOptions, Material, Mesh, MissingImages, Sampler, Scene, TextureRef, Wrap, geometry,
    pictures::{self, ImageUse},
    prune::{Prune, prune_textures},
    thin::{self, Stroke},
};

/// Largest polygon that is triangulated by ear clipping, which is quadratic; larger ones become triangle fans.
const MAX_EARS: usize = 2_000;

/// Reads an `.obj` file and its material libraries.
pub(crate) fn load(path: &Path, options: &LoadOptions) -> Result<Scene> {
    let bytes = super::contents(path)?;
    let text = String::from_utf8_lossy(&bytes);
    let mut reader = ObjReader {
        folder: path.parent().unwrap_or(Path::new("")).to_owned(),
        name: "object".to_owned(),
        ..ObjReader::default()
    };
    for (number, line) in logical_lines(&text) {
        reader.line(&line).with_context(|| format!("line {number}"))?;
    }
    let mut scene = reader.finish(options)?;
    scene.name = path.display().to_string();
    let file = path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned();
    scene.warnings.iter_mut().for_each(|w| *w = format!("{file}: {w}"));
    Ok(scene)
}

/// Statements of MTL files that name textures, beside those that begin with `map_`.
const TEXTURES: [&str; 5] = ["norm", "bump", "disp", "decal", "refl"];

/// Keywords that are followed by a name, which may contain a number sign.
const NAMES: [&str; 6] = ["newmtl", "usemtl", "mtllib", "o", "g", "s"];

/// Where a comment begins in a line: at a number sign, but behind a name only where a space follows it.
fn comment(line: &str) -> Option<usize> {
    let keyword = line.split_whitespace().next().unwrap_or_default();
    let is_named = NAMES.contains(&keyword) || keyword.starts_with("map_") || TEXTURES.contains(&keyword);
    match is_named {
        true => line.find("# "),
        false => line.find('#'),
    }
}

/// Lines without comments, numbered by their first line from 1. A backslash at the end of a line joins it with the
/// next, unless it ends a comment.
fn logical_lines(text: &str) -> impl Iterator<Item = (usize, Cow<'_, str>)> {
    let mut lines = text.lines().enumerate();
    std::iter::from_fn(move || {
        let (number, first) = lines.next()?;
        let mut line = Cow::Borrowed(first.trim_end());
        while let Some(begun) = line.strip_suffix('\\').filter(|line| !line.trim_start().starts_with('#')) {
            line = match lines.next() {
                Some((_, next)) => Cow::Owned(format!("{begun} {}", next.trim_end())),
                None => Cow::Owned(begun.to_owned()),
            };
        }
        if let Some(comment) = comment(&line) {
            line = match line {
                Cow::Borrowed(line) => Cow::Borrowed(&line[..comment]),
                Cow::Owned(line) => Cow::Owned(line[..comment].to_owned()),
            };
        }
        Some((number + 1, line))
    })
}

/// A multiplicative hash: keys are small numbers, and for a million of them a cryptographic hash is slow.
#[derive(Default)]
struct CornerHasher(u64);

impl Hasher for CornerHasher {
    fn finish(&self) -> u64 {
        // The hash table uses bits from both ends.
        self.0 ^ self.0 >> 32
    }

    fn write(&mut self, bytes: &[u8]) {
        bytes.iter().for_each(|&b| self.write_u64(u64::from(b)));
    }

    fn write_u32(&mut self, value: u32) {
        self.write_u64(u64::from(value));
    }

    fn write_isize(&mut self, value: isize) {
        self.write_u64(value as u64);
    }

    fn write_u64(&mut self, value: u64) {
        self.0 = (self.0.rotate_left(5) ^ value).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    }
}

/// A corner of a face: position, texture coordinate, normal.
type Corner = (u32, Option<u32>, Option<u32>);

/// Consecutive faces of equal object, material and presence of normals.
#[derive(Default)]
struct ObjGroup {
    name: String,
    material: Option<usize>,
    smooth: bool,
    corners: Vec<Corner>,
    strokes: Vec<Stroke>,
    /// Vertices of points and lines; a group has either these or `corners`.
    stroke_corners: Vec<Corner>,
}

#[derive(Default)]
struct ObjReader {
    folder: PathBuf,
    positions: Vec<[f32; 3]>,
    colors: Vec<Option<[f32; 3]>>,
    uvs: Vec<[f32; 2]>,
    normals: Vec<[f32; 3]>,
    groups: Vec<ObjGroup>,
    name: String,
    material: Option<usize>,
    materials: Vec<Material>,
    by_name: HashMap<String, usize>,
    pictures: Vec<ObjPicture>,
    /// Libraries, and all textures that they name, read or not.
    files: Vec<PathBuf>,
    warnings: Vec<String>,
    /// A material library is missing; this warning explains unknown material names, too.
    library_missing: bool,
}

/// Image of a material: colour, and opacity from another file.
#[derive(Debug, Clone, PartialEq)]
struct ObjPicture {
    color: Option<PathBuf>,
    alpha: Option<PathBuf>,
}

fn number(word: Option<&str>) -> Result<f32> {
    let word = word.context("a number is missing")?;
    word.parse().map_err(|_| anyhow!("\"{word}\" is not a number"))
}

fn numbers<const N: usize>(words: &mut SplitWhitespace<'_>) -> Result<[f32; N]> {
    let mut out = [0.0; N];
    for value in &mut out {
        *value = number(words.next())?;
    }
    Ok(out)
}

impl ObjReader {
    fn line(&mut self, line: &str) -> Result<()> {
        let mut words = line.split_whitespace();
        let Some(keyword) = words.next() else { return Ok(()) };
        let rest = line.trim_start()[keyword.len()..].trim();
        match keyword {
            "v" => {
                let mut p = numbers::<3>(&mut words)?;
                let more = words.map(|w| number(Some(w))).collect::<Result<Vec<_>>>()?;
                let color = match *more {
                    [w] => {
                        ensure!(w != 0.0, "the weight of a vertex is zero");
                        p = p.map(|x| x / w);
                        None
                    }
                    [r, g, b, ..] => Some([r, g, b]),
                    _ => None,
                };
                self.positions.push(p);
                self.colors.push(color);
            }
            "vt" => {
                let u = number(words.next())?;
                let v = words.next().map_or(Ok(0.0), |w| number(Some(w)))?;
                // Image rows count from the top here, and from the bottom in OBJ.
                self.uvs.push([u, 1.0 - v]);
            }
            "vn" => self.normals.push(numbers::<3>(&mut words)?),
            "f" => {
                let corners = words.map(|w| self.corner(w)).collect::<Result<Vec<_>>>()?;
                self.face(&corners)?;
            }
            "l" | "p" => {
                let corners = words.map(|w| self.corner(w)).collect::<Result<Vec<_>>>()?;
                let group = self.group(false, true);
                let first = group.stroke_corners.len() as u32;
                let count = corners.len() as u32;
                group.stroke_corners.extend(corners);
                if keyword == "p" {
                    group.strokes.extend((first..first + count).map(Stroke::Point));
                } else {
                    group.strokes.extend((1..count).map(|i| Stroke::Line(first + i - 1, first + i)));
                }
            }
            "o" | "g" if !rest.is_empty() => self.name = rest.to_owned(),
            "usemtl" => {
                self.material = self.by_name.get(rest).copied();
                if self.material.is_none() && !self.library_missing {
                    self.warn(format!("the material \"{rest}\" is not in any library; a grey one is taken"));
                }
            }
            "mtllib" => self.library(rest)?,
            _ => {}
        }
        Ok(())
    }

    fn warn(&mut self, what: String) {
        if !self.warnings.contains(&what) {
            self.warnings.push(what);
        }
    }

    /// Parses `v`, `v/vt`, `v//vn` or `v/vt/vn`: indices from 1, or from the end if negative.
    fn corner(&self, word: &str) -> Result<Corner> {
        fn index(text: &str, count: usize, what: &str) -> Result<u32> {
            let i: i64 = text.parse().map_err(|_| anyhow!("\"{text}\" is not an index"))?;
            let from_zero = if i < 0 { i.checked_add(count as i64) } else { i.checked_sub(1) };
            match from_zero {
                Some(i) if i >= 0 && (i as usize) < count => Ok(i as u32),
                _ => bail!("a face names {what} {text}, but there are {count} so far"),
            }
        }
        let mut parts = word.split('/');
        let position = index(parts.next().unwrap_or(""), self.positions.len(), "position")?;
        let uv = parts.next().filter(|t| !t.is_empty());
        let uv = uv.map(|t| index(t, self.uvs.len(), "texture coordinate")).transpose()?;
        let normal = parts.next().filter(|t| !t.is_empty());
        let normal = normal.map(|t| index(t, self.normals.len(), "normal")).transpose()?;
        Ok((position, uv, normal))
    }

    /// The group of the next face.
    fn group(&mut self, smooth: bool, strokes: bool) -> &mut ObjGroup {
        let fits = |g: &ObjGroup| {
            g.material == self.material
                && g.name == self.name
                && g.smooth == smooth
                && g.stroke_corners.is_empty() != strokes
        };
        if !self.groups.last().is_some_and(fits) {
            let (name, material) = (self.name.clone(), self.material);
            self.groups.push(ObjGroup { name, material, smooth, ..ObjGroup::default() });
        }
        let last = self.groups.len() - 1;
        &mut self.groups[last]
    }

    fn face(&mut self, corners: &[Corner]) -> Result<()> {
        ensure!(corners.len() >= 3, "a face has {} corners", corners.len());
        let smooth = corners.iter().all(|c| c.2.is_some());
        let triangles = match corners.len() {
            3 => vec![[0, 1, 2]],
            _ => {
                let at = |c: &Corner| Vec3::from(self.positions[c.0 as usize]).as_dvec3();
                triangulate(&corners.iter().map(at).collect::<Vec<_>>())
            }
        };
        let group = self.group(smooth, false);
        group.corners.extend(triangles.iter().flatten().map(|&i| corners[i]));
        Ok(())
    }

    /// Reads the libraries after `mtllib`: several names, or one name with spaces.
    fn library(&mut self, names: &str) -> Result<()> {
        let whole = self.folder.join(clean(names));
        let paths: Vec<PathBuf> = if whole.is_file() {
            vec![whole]
        } else {
            names.split_whitespace().map(|name| self.folder.join(clean(name))).collect()
        };
        self.files.extend_from_slice(&paths);
        for path in paths {
            match fs::read(&path) {
                Ok(bytes) => self
                    .materials(&String::from_utf8_lossy(&bytes))
                    .with_context(|| format!("material library {}", path.display()))?,
                Err(error) => {
                    self.library_missing = true;
                    let path = path.display();
                    self.warn(format!("the material library {path} cannot be read ({error}); grey is taken instead"));
                }
            }
        }
        Ok(())
    }

    fn materials(&mut self, text: &str) -> Result<()> {
        let mut current: Option<(String, Mtl)> = None;
        for (number, line) in logical_lines(text) {
            let mut words = line.split_whitespace();
            let Some(keyword) = words.next() else { continue };
            let rest = line.trim_start()[keyword.len()..].trim();
            if keyword == "newmtl" {
                if let Some((name, mtl)) = current.replace((rest.to_owned(), Mtl::default())) {
                    self.add_material(name, &mtl);
                }
            } else if let Some((_, mtl)) = &mut current {
                if keyword.starts_with("map_") || TEXTURES.contains(&keyword) {
                    self.files.extend(Map::parse(rest).ok().map(|map| self.folder.join(map.path)));
                }
                mtl.set(keyword, rest).with_context(|| format!("line {number}"))?;
            }
        }
        if let Some((name, mtl)) = current {
            self.add_material(name, &mtl);
        }
        Ok(())
    }

    fn add_material(&mut self, name: String, mtl: &Mtl) {
        let mut material = mtl.fold(&name);
        if mtl.map_kd.is_some() || mtl.map_d.is_some() {
            let options = mtl.map_kd.as_ref().or(mtl.map_d.as_ref());
            let picture = ObjPicture {
                color: mtl.map_kd.as_ref().map(|m| self.folder.join(&m.path)),
                alpha: mtl.map_d.as_ref().map(|m| self.folder.join(&m.path)),
            };
            material.base_color_texture = options.map(|m| m.reference(self.picture(picture.clone())));
            if picture.alpha.is_some() && material.alpha_mode == AlphaMode::Opaque {
                material.alpha_mode = AlphaMode::Mask(0.5);
            }
        }
        let plain = |r: &mut Self, map: &Map| {
            let color = Some(r.folder.join(&map.path));
            map.reference(r.picture(ObjPicture { color, alpha: None }))
        };
        if let Some(map) = &mtl.map_ke {
            material.emissive_texture = Some(plain(self, map));
        }
        if let Some(map) = &mtl.norm {
            material.normal_texture = Some(plain(self, map));
        }
        for warning in mtl.beyond_nature() {
            self.warn(format!("material \"{name}\": {warning}"));
        }
        for ignored in &mtl.ignored {
            self.warn(format!("material \"{name}\": {ignored} is not supported and is ignored"));
        }
        self.by_name.insert(name, self.materials.len());
        self.materials.push(material);
    }

    /// Index of an image; equal files share an index.
    fn picture(&mut self, picture: ObjPicture) -> usize {
        self.pictures.iter().position(|p| *p == picture).unwrap_or_else(|| {
            self.pictures.push(picture);
            self.pictures.len() - 1
        })
    }

    fn finish(mut self, options: &LoadOptions) -> Result<Scene> {
        if self.groups.iter().any(|g| g.material.is_none()) {
            let grey = Mtl { kd: Some([0.8; 3]), ..Mtl::default() };
            for group in self.groups.iter_mut().filter(|g| g.material.is_none()) {
                group.material = Some(self.materials.len());
            }
            self.materials.push(grey.fold("default"));
        }
        let groups = std::mem::take(&mut self.groups);
        let unread = self.prune_unused(options.prune, &groups);
        let images = self.decode(options.missing)?;
        let built: Vec<(Mesh, Vec<Stroke>, Vec<String>)> = groups.into_par_iter().map(|g| self.build(g)).collect();
        let mut scene = Scene { images, files: self.files, unread, warnings: self.warnings, ..Scene::default() };
        let mut strokes = Vec::new();
        for (mesh, lines, warnings) in built {
            scene.warnings.extend(warnings);
            let (name, world_from_object) = (mesh.name.clone(), DAffine3::IDENTITY);
            if !lines.is_empty() {
                strokes.push(thin::StrokeGroup { placements: vec![(name, world_from_object)], mesh, strokes: lines });
            } else if !mesh.indices.is_empty() {
                scene.instances.push(Instance { name, mesh: scene.meshes.len(), world_from_object });
                scene.meshes.push(mesh);
            }
        }
        thin::add(&strokes, &mut scene.meshes, &mut scene.instances);
        scene.materials = self.materials;
        Ok(scene)
    }

    /// Prunes the textures of all materials; OBJ files have no lights. Returns the reasons.
    fn prune_unused(&mut self, prune: Prune, groups: &[ObjGroup]) -> Vec<String> {
        let Some(ambient) = prune.ambient() else { return Vec::new() };
        let used: HashSet<usize> = groups.iter().filter_map(|group| group.material).collect();
        let materials = self.materials.iter_mut().enumerate();
        materials.flat_map(|(i, m)| prune_textures(m, used.contains(&i), ambient)).collect()
    }

    /// Decodes, in parallel, the images that the materials still use.
    fn decode(&mut self, missing: MissingImages) -> Result<Vec<Image>> {
        let mut places = vec![None; self.pictures.len()];
        let mut wanted = Vec::new();
        for texture in self.materials.iter_mut().flat_map(Material::textures_mut).flatten() {
            texture.image = *places[texture.image].get_or_insert_with(|| {
                wanted.push(&self.pictures[texture.image]);
                wanted.len() - 1
            });
        }
        let decoded: Vec<Result<(Image, Vec<String>)>> = wanted
            .par_iter()
            .enumerate()
            .map(|(image, picture)| decode(picture, missing, ImageUse::of(&self.materials, image)))
            .collect();
        let mut images = Vec::new();
        for decoded in decoded {
            let (image, warnings) = decoded?;
            images.push(image);
            warnings.into_iter().for_each(|warning| self.warn(warning));
        }
        Ok(images)
    }

    fn build(&self, group: ObjGroup) -> (Mesh, Vec<Stroke>, Vec<String>) {
        let mut warnings = Vec::new();
        let material = group.material.unwrap_or(0);
        let textured = {
            let m = &self.materials[material];
            m.base_color_texture.is_some() || m.emissive_texture.is_some() || m.normal_texture.is_some()
        };
        let is_strokes = !group.stroke_corners.is_empty();
        let corners = if is_strokes { &group.stroke_corners } else { &group.corners };
        let mut mesh = Mesh { name: group.name.clone(), material, ..Mesh::default() };
        let has_uvs = corners.iter().any(|c| c.1.is_some());
        if textured && corners.iter().any(|c| c.1.is_none()) {
            let name = &group.name;
            warnings.push(format!("object \"{name}\" has a texture but lacks coordinates; (0, 0) is taken"));
        }
        let colored = corners.iter().all(|c| self.colors[c.0 as usize].is_some());
        let mut known: HashMap<Corner, u32, BuildHasherDefault<CornerHasher>> = HashMap::default();
        let mut indices = Vec::with_capacity(corners.len());
        for &corner in corners {
            let next = mesh.positions.len() as u32;
            let index = *known.entry(corner).or_insert(next);
            indices.push(index);
            if index < next {
                continue;
            }
            let (position, uv, normal) = corner;
            mesh.positions.push(self.positions[position as usize]);
            if has_uvs || textured {
                mesh.uvs[0].push(uv.map_or([0.0; 2], |i| self.uvs[i as usize]));
            }
            if group.smooth {
                mesh.normals.extend(normal.map(|i| self.normals[i as usize]));
            }
            if colored && let Some([r, g, b]) = self.colors[position as usize] {
                mesh.colors.push([r, g, b, 1.0]);
            }
        }
        if is_strokes {
            let finite = |i: u32| mesh.positions[indices[i as usize] as usize].iter().all(|x| x.is_finite());
            let named = |stroke| match stroke {
                Stroke::Point(a) => finite(a).then(|| Stroke::Point(indices[a as usize])),
                Stroke::Line(a, b) => {
                    (finite(a) && finite(b)).then(|| Stroke::Line(indices[a as usize], indices[b as usize]))
                }
            };
            let strokes = group.strokes.iter().copied().filter_map(named).collect();
            return (mesh, strokes, warnings);
        }
        mesh.indices = indices.into();
        let tangent_set = self.materials[material].normal_texture.map(|_| 0);
        let repairs = geometry::finish(&mut mesh, tangent_set);
        warnings.extend(repairs.sentences(&format!("object \"{}\"", group.name)));
        (mesh, Vec::new(), warnings)
    }
}

/// Cleans a file name of MTL, which often has quotes and backslashes of Windows.
fn clean(name: &str) -> String {
    name.trim().trim_matches('"').replace('\\', "/")
}

/// Triangulates a polygon by ear clipping in the plane of its area vector; returns corner numbers.
fn triangulate(corners: &[DVec3]) -> Vec<[usize; 3]> {
    let n = corners.len();
    let fan = || (1..n - 1).map(|i| [0, i, i + 1]).collect();
    let origin = corners[0];
    let area: DVec3 =
        (1..n - 1).map(|i| (corners[i] - origin).cross(corners[i + 1] - origin)).fold(DVec3::ZERO, |a, b| a + b);
    let Some(normal) = area.try_normalize() else { return fan() };
    if n > MAX_EARS {
        return fan();
    }
    let (u, v) = normal.any_orthonormal_pair();
    let (u, v) = if u.cross(v).dot(normal) > 0.0 { (u, v) } else { (v, u) };
    let flat: Vec<DVec2> = corners.iter().map(|&p| DVec2::new((p - origin).dot(u), (p - origin).dot(v))).collect();
    let turn = |a: usize, b: usize, c: usize| (flat[b] - flat[a]).perp_dot(flat[c] - flat[a]);
    let mut left: Vec<usize> = (0..n).collect();
    let mut out = Vec::with_capacity(n - 2);
    while left.len() > 3 {
        let m = left.len();
        // Starting at corner 1 turns convex polygons into the usual fan.
        let ear = (1..=m).map(|i| i % m).find(|&i| {
            let (a, b, c) = (left[(i + m - 1) % m], left[i], left[(i + 1) % m]);
            turn(a, b, c) > 0.0
                && left.iter().all(|&p| {
                    p == a || p == b || p == c || turn(a, b, p) < 0.0 || turn(b, c, p) < 0.0 || turn(c, a, p) < 0.0
                })
        });
        // A self-intersecting polygon may have no ear; any corner will do.
        let i = ear.unwrap_or(1);
        out.push([left[(i + m - 1) % m], left[i], left[(i + 1) % m]]);
        left.remove(i);
    }
    out.push([left[0], left[1], left[2]]);
    out
}

fn read_picture(path: &Path) -> Result<Image> {
    let bytes = fs::read(path).map_err(|error| anyhow!(etalon_image::file::cause(&error)))?;
    let name = path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned();
    pictures::decode(name, &bytes)
}

/// The image of a material, with warnings about checkers in it.
fn decode(picture: &ObjPicture, missing: MissingImages, of: ImageUse) -> Result<(Image, Vec<String>)> {
    let mut warnings = Vec::new();
    let mut read = |path: &Path, of| {
        missing.replace(read_picture(path), &format!("the texture {}", path.display()), of, &mut warnings)
    };
    let image = match (&picture.color, &picture.alpha) {
        (Some(color), None) => read(color, of)?,
        (color, Some(alpha)) => {
            let alpha = read(alpha, ImageUse::Data)?;
            let mut out = match color {
                Some(color) => read(color, of)?,
                None => Image { rgba: vec![255; alpha.rgba.len()].into(), ..alpha.clone() },
            };
            let (w, h) = (out.width as usize, out.height as usize);
            let scale = |x: usize, from: usize, to: u32| (x * to as usize / from).min(to as usize - 1);
            for y in 0..h {
                for x in 0..w {
                    let at = scale(y, h, alpha.height) * alpha.width as usize + scale(x, w, alpha.width);
                    let [r, g, b] = std::array::from_fn(|i| u16::from(alpha.rgba[at * 4 + i]));
                    out.rgba[(y * w + x) * 4 + 3] = ((r + g + b) / 3) as u8;
                }
            }
            out
        }
        (None, None) => bail!("a material has a picture without a file"),
    };
    Ok((image, warnings))
}

/// A texture statement: file and supported options.
#[derive(Debug, Clone, PartialEq)]
struct Map {
    path: String,
    scale: [f32; 2],
    offset: [f32; 2],
    clamp: bool,
}

impl Map {
    fn parse(text: &str) -> Result<Self> {
        let mut map = Self { path: String::new(), scale: [1.0; 2], offset: [0.0; 2], clamp: false };
        let mut rest = text.trim();
        while let Some(option) = rest.strip_prefix('-') {
            let mut words = option.split_whitespace();
            let name = words.next().unwrap_or("");
            rest = option[name.len()..].trim_start();
            let is_vector = matches!(name, "s" | "o" | "t");
            let most = match name {
                "s" | "o" | "t" => 3,
                "mm" => 2,
                _ => 1,
            };
            let mut values = Vec::new();
            for i in 0..most {
                let word = rest.split_whitespace().next().unwrap_or("");
                let value = word.parse::<f32>();
                // Vectors may have fewer than three components; a word that is not a number is the file name.
                if is_vector && value.is_err() && i > 0 {
                    break;
                }
                map.clamp |= name == "clamp" && word == "on";
                values.extend(value);
                rest = rest[word.len()..].trim_start();
            }
            let pair = |default: f32| [values.first().copied(), values.get(1).copied()].map(|v| v.unwrap_or(default));
            match name {
                "s" => map.scale = pair(1.0),
                "o" => map.offset = pair(0.0),
                _ => {}
            }
        }
        ensure!(!rest.is_empty(), "a texture statement names no file");
        map.path = clean(rest);
        Ok(map)
    }

    fn reference(&self, image: usize) -> TextureRef {
        let wrap = if self.clamp { Wrap::Clamp } else { Wrap::Repeat };
        // OBJ scales and shifts a coordinate that points up; ours points down.
        let ([su, sv], [ou, ov]) = (self.scale, self.offset);
        let shift =
            if self.scale == [1.0; 2] && self.offset == [0.0; 2] { Vec2::ZERO } else { Vec2::new(ou, 1.0 - sv - ov) };
        TextureRef {
            image,
            uv_set: 0,
            uv_transform: Affine2::from_scale_angle_translation(Vec2::new(su, sv), 0.0, shift),
            sampler: Sampler { wrap_u: wrap, wrap_v: wrap, ..Sampler::default() },
        }
    }
}

/// Statements of one MTL material.
#[derive(Debug, Clone, Default)]
struct Mtl {
    kd: Option<[f32; 3]>,
    ks: Option<[f32; 3]>,
    ke: Option<[f32; 3]>,
    tf: Option<[f32; 3]>,
    ns: Option<f32>,
    ni: Option<f32>,
    d: Option<f32>,
    illum: Option<i32>,
    map_kd: Option<Map>,
    map_d: Option<Map>,
    map_ke: Option<Map>,
    norm: Option<Map>,
    ignored: Vec<String>,
}

fn color(text: &str) -> Result<[f32; 3]> {
    let mut words = text.split_whitespace();
    let r = number(words.next())?;
    // Green and blue are optional and default to red.
    let Some(g) = words.next() else { return Ok([r; 3]) };
    let rgb = [r, number(Some(g))?, number(words.next())?];
    ensure!(rgb.iter().all(|x| x.is_finite()), "the colour {text} is not finite");
    Ok(rgb)
}

fn finite(text: &str) -> Result<f32> {
    let value = number(text.split_whitespace().next())?;
    ensure!(value.is_finite(), "{text} is not finite");
    Ok(value)
}

impl Mtl {
    fn set(&mut self, keyword: &str, rest: &str) -> Result<()> {
        match keyword {
            "Kd" => self.kd = Some(color(rest)?),
            "Ks" => self.ks = Some(color(rest)?),
            "Ke" => self.ke = Some(color(rest)?),
            "Tf" => self.tf = Some(color(rest)?),
            "Ns" => self.ns = Some(finite(rest)?.max(0.0)),
            "Ni" => self.ni = Some(finite(rest)?),
            "d" => self.d = Some(finite(rest.trim_start_matches("-halo"))?.clamp(0.0, 1.0)),
            "Tr" => self.d = Some((1.0 - finite(rest)?).clamp(0.0, 1.0)),
            "illum" => self.illum = Some(finite(rest)? as i32),
            "map_Kd" => self.map_kd = Some(Map::parse(rest)?),
            "map_d" => self.map_d = Some(Map::parse(rest)?),
            "map_Ke" => self.map_ke = Some(Map::parse(rest)?),
            "norm" | "map_Kn" => self.norm = Some(Map::parse(rest)?),
            "map_Ks" | "map_Ns" | "map_bump" | "map_Bump" | "bump" | "disp" | "refl" => {
                self.ignored.push(keyword.to_owned());
            }
            _ => {}
        }
        Ok(())
    }

    /// Warnings about physically impossible values, and the values that replace them.
    fn beyond_nature(&self) -> Vec<String> {
        let mut said = Vec::new();
        for (keyword, share) in [("Kd", self.kd), ("Ks", self.ks), ("Tf", self.tf)] {
            if let Some(&out) = share.iter().flatten().find(|x| !(0.0..=1.0).contains(*x)) {
                let makes = if out > 1.0 { "would send more light than there is" } else { "is negative" };
                said.push(format!("{keyword} {out} {makes} and is clamped to 0 … 1"));
            }
        }
        if let Some(out) = self.ke.iter().flatten().find(|x| **x < 0.0) {
            said.push(format!("Ke {out} would take light away and is read as 0"));
        }
        // Lecture B6's bound k_s ≤ (shine + 2)/2π (1 − π k_d), in the meaning of MTL files: Kd = π k_d is an albedo,
        // and Ks = 2π k_s/(shine + 2) is the albedo of the lobe.
        if let (false, Some(kd), Some(ks)) = (matches!(self.illum, Some(0 | 1 | 4 | 6 | 7 | 9)), self.kd, self.ks) {
            let most = (0..3).map(|i| kd[i].clamp(0.0, 1.0) + ks[i].clamp(0.0, 1.0)).fold(0.0, f32::max);
            // Tolerates values of two decimals whose sum is rounded up.
            if most > 1.005 {
                said.push(format!(
                    "Kd + Ks is {most:.2}, more light than there is; of Kd the share is drawn that Ks lets into the surface"
                ));
            }
        }
        said
    }

    fn fold(&self, name: &str) -> Material {
        let kd = self.kd.unwrap_or(if self.map_kd.is_some() { [1.0; 3] } else { [0.8; 3] }).map(|x| x.clamp(0.0, 1.0));
        let illum = self.illum.unwrap_or(2);
        let d = self.d.unwrap_or(1.0);
        let ns = self.ns.unwrap_or(0.0);
        let ior = self.ni.filter(|&n| n > 1.0).unwrap_or(1.5);
        let filtered = self.tf.is_some_and(|tf| tf.iter().any(|&x| x < 1.0));
        let is_glass = matches!(illum, 4 | 6 | 7 | 9) || (self.ni.is_some() && filtered && d < 1.0);
        let mut m = Material {
            name: name.to_owned(),
            base_color: [kd[0], kd[1], kd[2], 1.0],
            metallic: 0.0,
            // The lobe cos^s of half vectors has the width of a microfacet distribution with this α.
            roughness: (2.0 / (ns + 2.0)).sqrt().sqrt(),
            emissive: self.ke.unwrap_or([0.0; 3]).map(|x| x.max(0.0)),
            ior,
            unlit: illum == 0,
            ..Material::default()
        };
        match (illum, self.ks) {
            (0 | 1, _) => m.specular = 0.0,
            (_, Some(ks)) => {
                // KHR_materials_specular multiplies the F0 of the index of refraction.
                let f0 = ((ior - 1.0) / (ior + 1.0)).powi(2);
                if !is_glass {
                    m.specular_color = ks.map(|k| k.clamp(0.0, 1.0) / f0);
                }
            }
            (_, None) => {}
        }
        if is_glass {
            m.transmission = 1.0;
            let tint = self.tf.unwrap_or([1.0; 3]).map(|x| x.clamp(0.0, 1.0));
            m.base_color = [tint[0], tint[1], tint[2], 1.0];
            // illum 6 and 7 refract: a solid. illum 4 and 9 are glass without refraction: a thin-walled surface.
            m.thickness = if matches!(illum, 6 | 7) && self.ni.is_some_and(|n| n > 1.0) { 1.0 } else { 0.0 };
        } else if d < 1.0 {
            m.base_color[3] = d;
            m.alpha_mode = AlphaMode::Blend;
        }
        m
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_concave_polygon_keeps_its_area() {
        // An arrowhead: corner 3 is reflex, so a fan from corner 0 or 2 would leave the polygon.
        let p = [(0.0, 0.0), (4.0, 0.0), (4.0, 4.0), (3.0, 1.0)].map(|(x, y)| DVec3::new(x, y, 1.0));
        for shift in 0..4 {
            let turned: Vec<DVec3> = (0..4).map(|i| p[(i + shift) % 4]).collect();
            let area = |t: &[usize; 3]| {
                let [a, b, c] = t.map(|i| turned[i]);
                (b - a).cross(c - a).z / 2.0
            };
            let areas: Vec<f64> = triangulate(&turned).iter().map(area).collect();
            assert!(areas.iter().all(|&a| a > 0.0), "{areas:?}");
            assert!((areas.iter().sum::<f64>() - 4.0).abs() < 1e-12, "{areas:?}");
        }
    }

    #[test]
    fn number_signs_are_parts_of_names() {
        let text =
            "# exported to D:\\models\\\nnewmtl Material #25\nmap_Kd wood#2.png # oak\nv 1 2 3#4\nf 1 \\\n2 3 # last";
        let lines: Vec<String> = logical_lines(text).map(|(_, line)| line.trim_end().to_owned()).collect();
        assert_eq!(lines, ["", "newmtl Material #25", "map_Kd wood#2.png", "v 1 2 3", "f 1  2 3"]);
    }

    #[test]
    fn texture_options_are_read_around_the_file_name() {
        let map = Map::parse("-s 2 3 1 -o 0.5 -clamp on -bm 0.3 my picture.png").unwrap();
        assert_eq!(map, Map { path: "my picture.png".into(), scale: [2.0, 3.0], offset: [0.5, 0.0], clamp: true });
        // OBJ's v of 0.25 at scale 3 is 0.75 from the bottom: 0.25 from the top.
        let uv = map.reference(0).uv_transform.transform_point2(Vec2::new(0.25, 0.75));
        assert!((uv - Vec2::new(1.0, 0.25)).length() < 1e-6, "{uv}");
        assert!(Map::parse("-s 1 1 1").is_err());
    }

    #[test]
    fn phong_numbers_become_roughness_and_f0() {
        let mut mtl = Mtl::default();
        for (k, v) in [("Kd", "0.1 0.2 0.3"), ("Ks", "0.4 0.4 0.4"), ("Ns", "30"), ("illum", "2"), ("d", "0.5")] {
            mtl.set(k, v).unwrap();
        }
        let m = mtl.fold("x");
        assert!((m.roughness - 0.25_f32.sqrt()).abs() < 1e-6, "α = sqrt(2/32) = 0.25");
        assert!((m.specular_color[0] * 0.04 - 0.4).abs() < 1e-6);
        assert_eq!((m.base_color, m.alpha_mode), ([0.1, 0.2, 0.3, 0.5], AlphaMode::Blend));
        mtl.set("illum", "7").unwrap();
        mtl.set("Ni", "1.33").unwrap();
        let glass = mtl.fold("x");
        assert_eq!((glass.transmission, glass.ior, glass.alpha_mode), (1.0, 1.33, AlphaMode::Opaque));
        mtl.set("illum", "0").unwrap();
        assert!(mtl.fold("x").unlit);
        assert!(mtl.set("Kd", "1 2").is_err());
    }
}
