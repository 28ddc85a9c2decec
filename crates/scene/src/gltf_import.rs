//! glTF 2.0 import into a [`Scene`].
//!
//! Read glTF 2.0 chapter 3. The node hierarchy is flattened: one [`Instance`] for each primitive of each mesh node.
//! Nodes share geometry unless a skin or morph targets deform it. Files are not trusted: every index is checked before
//! use, and every failure is reported in one sentence.

use std::{
    collections::{HashMap, HashSet},
    path::{Path, PathBuf},
};

use anyhow::{Context, Result, ensure};
use glam::{DAffine3, DMat3, DMat4, DVec3, Mat4, Vec3};
use gltf::json::{
    self,
    camera::Type as CameraType,
    extensions::scene::khr_lights_punctual::Type as LightType,
    mesh::{Mode, Semantic},
    validation::Checked,
};
use rayon::prelude::*;

use super::{
    Camera, Instance, Light, LightKind, LoadOptions, Material, Mesh, Projection, Scene, Shared,
    accessor::Accessor,
    container,
    document::Document,
    geometry, gltf_extras,
    gltf_material::{self, KnownImages},
    lenient,
    names::keys,
    nodes::{Nodes, chosen_scene, end, label, playing},
    outline::{Animation, FilePart, Outline, OutlineNode},
    prune::{Coordinates, prune_textures, unused_coordinates},
    thin::{self, Stroke},
};

/// Static parts of a file, by their index in the file, cached over all times of its animation.
#[derive(Default)]
struct StillParts {
    images: KnownImages,
    /// Undeformed primitives, by mesh and primitive.
    resting: HashMap<(usize, usize), Mesh>,
}

/// A file that is read at several times of its animation; static parts are read once.
pub(crate) struct GltfFile {
    path: PathBuf,
    document: Document<'static>,
    warnings: Vec<String>,
    known: StillParts,
}

impl GltfFile {
    pub(crate) fn open(path: &Path, options: &LoadOptions) -> Result<Self> {
        let bytes = super::contents(path)?;
        let mut warnings = Vec::new();
        let document = opened(&bytes, path, options, &mut warnings)?.into_owned();
        Ok(Self { path: path.to_owned(), document, warnings, known: StillParts::default() })
    }

    pub(crate) fn at(&mut self, options: &LoadOptions) -> Result<Scene> {
        read(&mut self.document, &self.path, options, self.warnings.clone(), &mut self.known)
    }
}

/// Reads a `.gltf` or `.glb` file.
pub(crate) fn load(path: &Path, options: &LoadOptions) -> Result<Scene> {
    let bytes = super::contents(path)?;
    let mut warnings = Vec::new();
    let mut document = opened(&bytes, path, options, &mut warnings)?;
    read(&mut document, path, options, warnings, &mut StillParts::default())
}

fn opened<'b>(bytes: &'b [u8], path: &Path, options: &LoadOptions, warnings: &mut Vec<String>) -> Result<Document<'b>> {
    let mut document = container::open(bytes, path, warnings)?;
    if let Some(variant) = &options.variant {
        document.choose_variant(variant)?;
    }
    Ok(document)
}

/// The scene at the time of the options; the document is the same afterwards.
fn read(
    document: &mut Document<'_>,
    path: &Path,
    options: &LoadOptions,
    mut warnings: Vec<String>,
    known: &mut StillParts,
) -> Result<Scene> {
    let plays = playing(document, options, &mut warnings)?;
    match options.time.filter(|_| !document.pointers.is_empty()) {
        Some(time) => {
            let posed = lenient::at(document, &plays, time)?;
            let resting = std::mem::replace(&mut document.root, posed);
            let scene = read_posed(document, path, options, &plays, warnings, known);
            document.root = resting;
            scene
        }
        None => read_posed(document, path, options, &plays, warnings, known),
    }
}

fn read_posed(
    document: &Document<'_>,
    path: &Path,
    options: &LoadOptions,
    plays: &[bool],
    mut warnings: Vec<String>,
    known: &mut StillParts,
) -> Result<Scene> {
    let nodes = Nodes::new(document, options, plays, &mut warnings)?;
    let mut materials = gltf_material::read(document, &mut warnings)?;
    if known.resting.is_empty() {
        check_unseen_meshes(document)?;
    }
    let (lit_nodes, lights) = lights(document, &nodes, &mut warnings)?.into_iter().unzip::<_, _, Vec<_>, Vec<_>>();
    let mut placing = InstancePlacer::new(document, &nodes, &mut materials.materials, &mut warnings)?;
    let unread = placing.prune_unused(options.prune.ambient());
    let (meshes, instances, placed_nodes) = placing.run(&mut known.resting)?;
    let images = materials.decode(document, &mut known.images, options.missing, &mut warnings)?;
    let (eye_nodes, cameras) = cameras(document, &nodes, &mut warnings)?.into_iter().unzip::<_, _, Vec<_>, Vec<_>>();
    let outline = outline(document, &nodes, options, plays, [&placed_nodes, &lit_nodes, &eye_nodes])?;
    let file = path.file_name().unwrap_or(path.as_os_str()).to_string_lossy();
    Ok(Scene {
        name: path.display().to_string(),
        meshes,
        instances,
        materials: materials.materials,
        images,
        lights,
        studio: None,
        cameras,
        duration: nodes.duration,
        outline,
        files: document.files(),
        unread,
        warnings: warnings.into_iter().map(|w| format!("{file}: {w}")).collect(),
    })
}

/// What the file contains. `users` are the nodes of instances, lights and cameras, in the order of their lists.
fn outline(
    document: &Document<'_>,
    nodes: &Nodes,
    options: &LoadOptions,
    plays: &[bool],
    users: [&[usize]; 3],
) -> Result<Outline> {
    let root = &document.root;
    let names: Vec<Option<&str>> = root.nodes.iter().map(|node| node.name.as_deref()).collect();
    let keys = keys(&names);
    let mut first = HashMap::new();
    for (index, name) in names.iter().enumerate() {
        first.entry(*name).or_insert(index);
    }
    let is_shown: HashSet<usize> = nodes.shown.iter().copied().collect();
    // Parents before their children, children in the order of the file.
    let mut open: Vec<usize> = nodes.shown.clone();
    open.retain(|&node| nodes.parents[node].is_none_or(|parent| !is_shown.contains(&parent)));
    open.reverse();
    let mut place = vec![None; root.nodes.len()];
    let mut found: Vec<OutlineNode> = Vec::new();
    while let Some(node) = open.pop() {
        place[node] = Some(found.len());
        found.push(OutlineNode {
            name: names[node].map_or_else(|| format!("node {node}"), str::to_owned),
            key: keys[node].clone(),
            index: node,
            is_named: names[node].is_some() && first[&names[node]] == node,
            parent: nodes.parents[node].and_then(|parent| place[parent]),
            hidden: nodes.hidden[node],
            ..OutlineNode::default()
        });
        let children = root.nodes[node].children.iter().flatten().map(json::Index::value);
        open.extend(children.filter(|child| is_shown.contains(child)).collect::<Vec<_>>().into_iter().rev());
    }
    for (list, users) in users.into_iter().enumerate() {
        for (index, &node) in users.iter().enumerate() {
            let Some(at) = place[node] else { continue };
            let OutlineNode { instances, lights, cameras, .. } = &mut found[at];
            [instances, lights, cameras][list].push(index);
        }
    }
    let variants = root.extensions.as_ref().and_then(|extensions| extensions.khr_materials_variants.as_ref());
    // The word `all` chooses all of them.
    let titles: Vec<Option<&str>> = root.animations.iter().map(|animation| animation.name.as_deref()).collect();
    let titles = FilePart::list(&titles.iter().map(|name| name.filter(|name| *name != "all")).collect::<Vec<_>>());
    let animations = root.animations.iter().zip(plays).zip(titles).map(|((animation, &plays), named)| Animation {
        named,
        seconds: end(document, animation).unwrap_or_default(),
        plays,
    });
    Ok(Outline {
        scenes: FilePart::list(&root.scenes.iter().map(|scene| scene.name.as_deref()).collect::<Vec<_>>()),
        scene: chosen_scene(root, options.scene.as_deref())?,
        variants: FilePart::list(
            &variants.iter().flat_map(|all| &all.variants).map(|one| Some(&*one.name)).collect::<Vec<_>>(),
        ),
        animations: animations.collect(),
        nodes: found,
    })
}

/// Name of a primitive for messages.
fn place(document: &Document<'_>, mesh: usize, primitive: usize) -> String {
    match document.root.meshes.get(mesh).and_then(|m| m.name.as_deref()) {
        Some(name) => format!("mesh {mesh} \"{name}\" primitive {primitive}"),
        None => format!("mesh {mesh} primitive {primitive}"),
    }
}

/// Checks the ranges of all meshes, including those that no node of the scene uses: a broken file is always an error.
fn check_unseen_meshes(document: &Document<'_>) -> Result<()> {
    for (m, mesh) in document.root.meshes.iter().enumerate() {
        for (p, primitive) in mesh.primitives.iter().enumerate() {
            check_ranges(document, primitive).with_context(|| place(document, m, p))?;
        }
    }
    Ok(())
}

fn check_ranges(document: &Document<'_>, primitive: &json::mesh::Primitive) -> Result<()> {
    let mut vertices: Option<usize> = None;
    for (semantic, accessor) in &primitive.attributes {
        let count = Accessor::new(document, accessor.value())?.count;
        let expected = *vertices.get_or_insert(count);
        ensure!(
            count == expected,
            "accessor {} ({}) has {count} elements, but another attribute has {expected}",
            accessor.value(),
            semantic.to_string()
        );
    }
    let vertices = vertices.unwrap_or(0);
    if let Some(accessor) = primitive.indices {
        let indices = Accessor::new(document, accessor.value())?.indices()?;
        if let Some(&max) = indices.iter().max() {
            ensure!(
                (max as usize) < vertices,
                "accessor {} has the index {max}, but there are {vertices} vertices",
                accessor.value()
            );
        }
    }
    for target in primitive.targets.iter().flatten() {
        for accessor in [target.positions, target.normals, target.tangents].into_iter().flatten() {
            let count = Accessor::new(document, accessor.value())?.count;
            ensure!(
                count == vertices,
                "accessor {} (a morph target) has {count} elements, but there are {vertices} vertices",
                accessor.value()
            );
        }
    }
    Ok(())
}

/// Deformation of a mesh at one node; nodes with equal poses share geometry.
struct Pose {
    weights: Vec<f32>,
    /// World transform of each joint times its inverse bind matrix.
    joints: Option<Vec<DAffine3>>,
}

impl Pose {
    fn is_rest(&self) -> bool {
        self.joints.is_none() && self.weights.iter().all(|&w| w == 0.0)
    }
}

/// A primitive to be built, and the nodes that instantiate it.
struct PrimitiveJob {
    mesh: usize,
    primitive: usize,
    pose: Pose,
    nodes: Vec<usize>,
}

/// A built primitive.
struct BuiltPrimitive {
    mesh: Mesh,
    /// Corner pairs (lines) or single corners (points) that become thin triangles.
    strokes: Vec<Stroke>,
    warnings: Vec<String>,
}

struct InstancePlacer<'d, 'b, 'w> {
    document: &'d Document<'b>,
    nodes: &'d Nodes,
    materials: &'w mut Vec<Material>,
    warnings: &'w mut Vec<String>,
    jobs: Vec<PrimitiveJob>,
    /// Unused attributes are read, too: nothing is pruned.
    everything: bool,
}

impl<'d, 'b, 'w> InstancePlacer<'d, 'b, 'w> {
    fn new(
        document: &'d Document<'b>,
        nodes: &'d Nodes,
        materials: &'w mut Vec<Material>,
        warnings: &'w mut Vec<String>,
    ) -> Result<Self> {
        let mut placing = Self { document, nodes, materials, warnings, jobs: Vec::new(), everything: true };
        placing.jobs = placing.jobs()?;
        if placing.jobs.iter().any(|job| placing.material(job).is_none()) {
            placing.materials.push(Material::default());
        }
        Ok(placing)
    }

    fn material(&self, job: &PrimitiveJob) -> Option<usize> {
        self.document.root.meshes[job.mesh].primitives[job.primitive].material.map(|m| m.value())
    }

    /// Prunes the textures of all materials; `None` for `ambient` prunes nothing. Returns the reasons.
    fn prune_unused(&mut self, ambient: Option<bool>) -> Vec<String> {
        let Some(ambient) = ambient else { return Vec::new() };
        self.everything = false;
        let used: HashSet<usize> = self.jobs.iter().filter_map(|job| self.material(job)).collect();
        let materials = self.materials.iter_mut().enumerate();
        let mut unread: Vec<String> =
            materials.flat_map(|(i, m)| prune_textures(m, used.contains(&i), ambient)).collect();
        for job in &self.jobs {
            let read = self.material(job).map_or([false; 2], |i| Coordinates::of(&self.materials[i]).kept);
            let json = &self.document.root.meshes[job.mesh].primitives[job.primitive];
            let there = |set: usize| json.attributes.contains_key(&Checked::Valid(Semantic::TexCoords(set as u32)));
            let name = self.document.root.meshes[job.mesh].name.clone().unwrap_or_else(|| format!("mesh {}", job.mesh));
            unread.extend((0..2).filter(|&set| there(set) && !read[set]).map(|set| unused_coordinates(&name, set)));
        }
        unread.dedup();
        unread
    }

    /// Builds meshes, instances, and the node of each instance; undeformed meshes are cached in `resting` for other
    /// times of the animation.
    fn run(self, resting: &mut HashMap<(usize, usize), Mesh>) -> Result<(Vec<Mesh>, Vec<Instance>, Vec<usize>)> {
        let (document, materials): (_, &[Material]) = (self.document, self.materials);
        let (jobs, everything) = (&self.jobs, self.everything);
        // A material that a pointer animates may need other coordinates and tangents at another time.
        let keeps = |job: &PrimitiveJob| job.pose.is_rest() && document.pointers.is_empty();
        let built = jobs
            .par_iter()
            .map(|job| match resting.get(&(job.mesh, job.primitive)).filter(|_| keeps(job)) {
                Some(mesh) => Ok(BuiltPrimitive { mesh: mesh.clone(), strokes: Vec::new(), warnings: Vec::new() }),
                None => build(document, materials, job, everything)
                    .with_context(|| place(document, job.mesh, job.primitive)),
            })
            .collect::<Result<Vec<_>>>()?;
        for (job, built) in jobs.iter().zip(&built) {
            if keeps(job) && built.strokes.is_empty() {
                resting.entry((job.mesh, job.primitive)).or_insert_with(|| built.mesh.clone());
            }
        }
        let mut meshes: Vec<Mesh> = Vec::with_capacity(built.len());
        let mut instances = Vec::new();
        let (mut strokes, mut stroke_nodes) = (Vec::new(), Vec::new());
        let mut warnings = Vec::new();
        for (job, built) in jobs.iter().zip(built) {
            warnings.extend(built.warnings);
            let placements: Vec<_> = job
                .nodes
                .iter()
                .flat_map(|&node| self.placements(job, node).into_iter().map(move |at| (node, at)))
                .collect();
            if !built.strokes.is_empty() {
                stroke_nodes.extend(placements.iter().map(|(node, _)| *node));
                let placements = placements.into_iter().map(|(node, world)| (self.node_name(node), world)).collect();
                strokes.push(thin::StrokeGroup { placements, mesh: built.mesh, strokes: built.strokes });
                continue;
            }
            if built.mesh.indices.is_empty() {
                continue;
            }
            for (node, world_from_object) in placements {
                if cofactors(&world_from_object.matrix3) == DMat3::ZERO {
                    warnings.push(format!("{} is scaled to nothing and is left out", label(document, node)));
                    continue;
                }
                instances.push((node, Instance { name: self.node_name(node), mesh: meshes.len(), world_from_object }));
            }
            meshes.push(built.mesh);
        }
        self.warnings.append(&mut warnings);
        instances.sort_by_key(|(node, _)| *node);
        let (mut nodes, mut instances): (Vec<usize>, Vec<Instance>) = instances.into_iter().unzip();
        thin::add(&strokes, &mut meshes, &mut instances);
        nodes.append(&mut stroke_nodes);
        Ok((meshes, instances, nodes))
    }

    fn node_name(&self, node: usize) -> String {
        self.document.root.nodes[node].name.clone().unwrap_or_else(|| format!("node {node}"))
    }

    /// Transforms of a node's instances. Skinned meshes are in world space already: their joints replace the node's
    /// transform.
    fn placements(&self, job: &PrimitiveJob, node: usize) -> Vec<DAffine3> {
        let world_from_node = self.nodes.world_from_node[node];
        match (&job.pose.joints, &self.nodes.copies[node]) {
            (Some(_), _) => vec![DAffine3::IDENTITY],
            (None, None) => vec![world_from_node],
            (None, Some(copies)) => copies.iter().map(|copy| world_from_node * *copy).collect(),
        }
    }

    fn jobs(&self) -> Result<Vec<PrimitiveJob>> {
        let root = &self.document.root;
        let mut jobs: Vec<PrimitiveJob> = Vec::new();
        let mut shared: HashMap<(usize, usize), usize> = HashMap::new();
        for &node in self.nodes.shown.iter().filter(|&&node| !self.nodes.hidden[node]) {
            let Some(mesh) = root.nodes[node].mesh.map(|m| m.value()) else { continue };
            for primitive in 0..root.meshes[mesh].primitives.len() {
                let pose = self.pose(node, mesh, primitive).with_context(|| label(self.document, node))?;
                if pose.is_rest() {
                    let slot = *shared.entry((mesh, primitive)).or_insert(jobs.len());
                    if let Some(job) = jobs.get_mut(slot) {
                        job.nodes.push(node);
                        continue;
                    }
                }
                jobs.push(PrimitiveJob { mesh, primitive, pose, nodes: vec![node] });
            }
        }
        Ok(jobs)
    }

    fn pose(&self, node: usize, mesh: usize, primitive: usize) -> Result<Pose> {
        let root = &self.document.root;
        let json = &root.nodes[node];
        let targets = root.meshes[mesh].primitives[primitive].targets.as_ref().map_or(0, Vec::len);
        let weights = match (&self.nodes.animated_weights[node], &json.weights, &root.meshes[mesh].weights) {
            (Some(w), _, _) | (None, Some(w), _) | (None, None, Some(w)) => w.clone(),
            (None, None, None) => Vec::new(),
        };
        ensure!(
            weights.is_empty() || weights.len() == targets,
            "{} morph weights are given for {targets} targets",
            weights.len()
        );
        ensure!(weights.iter().all(|w| w.is_finite()), "a morph weight is not finite");
        let joints = match json.skin {
            Some(skin) => Some(self.joints(skin.value()).with_context(|| format!("skin {}", skin.value()))?),
            None => None,
        };
        Ok(Pose { weights, joints })
    }

    fn joints(&self, skin: usize) -> Result<Vec<DAffine3>> {
        let json = &self.document.root.skins[skin];
        let inverse_binds = match json.inverse_bind_matrices {
            Some(accessor) => {
                let matrices = Accessor::new(self.document, accessor.value())?.floats::<16>()?;
                ensure!(
                    matrices.len() >= json.joints.len(),
                    "accessor {} has {} inverse bind matrices for {} joints",
                    accessor.value(),
                    matrices.len(),
                    json.joints.len()
                );
                matrices
            }
            None => vec![Mat4::IDENTITY.to_cols_array(); json.joints.len()],
        };
        json.joints
            .iter()
            .zip(inverse_binds)
            .enumerate()
            .map(|(i, (joint, bind))| {
                let bind = DAffine3::from_mat4(DMat4::from_cols_array(&bind.map(f64::from)));
                let joint = self.nodes.world_from_node[joint.value()] * bind;
                ensure!(joint.is_finite(), "the matrix of joint {i} is not finite");
                Ok(joint)
            })
            .collect()
    }
}

/// Cofactor matrix, columns b×c, c×a, a×b: the inverse transpose times the determinant, without a division.
fn cofactors(m: &DMat3) -> DMat3 {
    let (a, b, c) = (m.x_axis, m.y_axis, m.z_axis);
    DMat3::from_cols(b.cross(c), c.cross(a), a.cross(b))
}

fn build(
    document: &Document<'_>,
    materials: &[Material],
    job: &PrimitiveJob,
    everything: bool,
) -> Result<BuiltPrimitive> {
    let root = &document.root;
    let json = &root.meshes[job.mesh].primitives[job.primitive];
    let place = place(document, job.mesh, job.primitive);
    let mut warnings = Vec::new();
    let get = |semantic: Semantic| {
        json.attributes
            .get(&Checked::Valid(semantic))
            .map(|accessor| Accessor::new(document, accessor.value()))
            .transpose()
    };
    let positions = get(Semantic::Positions)?.context("it has no POSITION attribute")?.floats::<3>()?;
    let many = root.meshes[job.mesh].primitives.len() > 1;
    let name = root.meshes[job.mesh].name.clone().unwrap_or_else(|| format!("mesh {}", job.mesh));
    // Primitives without a material get glTF's default material, the last one.
    let material = json.material.map_or(materials.len() - 1, |m| m.value());
    let read = Coordinates::of(&materials[material]);
    // Tangents that a primitive lacks are made from the coordinates of their set.
    let has_tangents = json.attributes.contains_key(&Checked::Valid(Semantic::Tangents));
    let makes_tangents = |set: usize| read.tangents == Some(set) && !has_tangents;
    let uvs = |set: usize| match get(Semantic::TexCoords(set as u32))? {
        Some(accessor) if everything || read.kept[set] || makes_tangents(set) => accessor.floats::<2>(),
        _ => Ok(Vec::new()),
    };
    let mut mesh = Mesh {
        name: if many { format!("{name} primitive {}", job.primitive) } else { name },
        positions: positions.into(),
        normals: get(Semantic::Normals)?.map_or(Ok(Vec::new()), |a| a.floats::<3>())?.into(),
        tangents: match read.tangents {
            Some(_) => get(Semantic::Tangents)?.map_or(Ok(Vec::new()), |a| a.floats::<4>())?.into(),
            None => Shared::default(),
        },
        uvs: [uvs(0)?.into(), uvs(1)?.into()],
        colors: get(Semantic::Colors(0))?.map_or(Ok(Vec::new()), |a| a.colors())?.into(),
        indices: Shared::default(),
        material,
    };
    for set in 0..2 {
        if read.sets[set] && mesh.uvs[set].is_empty() {
            warnings.push(format!("{place}: a texture uses TEXCOORD_{set}, which is missing; (0, 0) is taken"));
            mesh.uvs[set] = vec![[0.0; 2]; mesh.positions.len()].into();
        }
    }
    morph(document, json, &job.pose.weights, &mut mesh)?;
    let mirrored = match &job.pose.joints {
        Some(joints) => {
            let skin = read_skin(&get, mesh.positions.len(), joints.len())?;
            if skin.unweighted > 0 {
                warnings
                    .push(format!("{place}: {} vertices without weights follow their first joint", skin.unweighted));
            }
            bend(&mut mesh, &skin, joints)
        }
        None => false,
    };
    let indices = match json.indices {
        Some(accessor) => Accessor::new(document, accessor.value())?.indices()?,
        None => (0..u32::try_from(mesh.positions.len()).context("it has more than 2^32 vertices")?).collect(),
    };
    let Checked::Valid(mode) = json.mode else { anyhow::bail!("its mode is unknown") };
    let strokes = strokes(mode, &indices);
    if let Some(strokes) = strokes {
        mesh.normals = Shared::default();
        mesh.tangents = Shared::default();
        let finite = |i: u32| mesh.positions[i as usize].iter().all(|x| x.is_finite());
        let before = strokes.len();
        let strokes: Vec<Stroke> = strokes
            .into_iter()
            .filter(|s| match *s {
                Stroke::Point(a) => finite(a),
                Stroke::Line(a, b) => finite(a) && finite(b),
            })
            .collect();
        if strokes.len() < before {
            warnings.push(format!(
                "{place}: {} point(s) or line(s) that are not finite were dropped",
                before - strokes.len()
            ));
        }
        return Ok(BuiltPrimitive { mesh, strokes, warnings });
    }
    let (triangles, left_over) = triangles(mode, indices);
    if left_over > 0 {
        warnings.push(format!("{place}: {left_over} indices at the end make no triangle and are ignored"));
    }
    mesh.indices = triangles.into();
    if mirrored {
        mesh.indices.as_chunks_mut::<3>().0.iter_mut().for_each(|t| t.swap(1, 2));
    }
    let repairs = geometry::finish(&mut mesh, read.tangents);
    warnings.extend(repairs.sentences(&place));
    Ok(BuiltPrimitive { mesh, strokes: Vec::new(), warnings })
}

/// Points and lines of a primitive; `None` for triangles.
fn strokes(mode: Mode, indices: &[u32]) -> Option<Vec<Stroke>> {
    let line = |&[a, b]: &[u32; 2]| Stroke::Line(a, b);
    let chain = |w: &[u32]| Stroke::Line(w[0], w[1]);
    Some(match mode {
        Mode::Points => indices.iter().map(|&i| Stroke::Point(i)).collect(),
        Mode::Lines => indices.as_chunks::<2>().0.iter().map(line).collect(),
        Mode::LineStrip => indices.windows(2).map(chain).collect(),
        Mode::LineLoop => {
            let close = (indices.len() > 2).then(|| Stroke::Line(indices[indices.len() - 1], indices[0]));
            indices.windows(2).map(chain).chain(close).collect()
        }
        _ => return None,
    })
}

/// Triangle list of a primitive, and the number of indices left over.
fn triangles(mode: Mode, mut indices: Vec<u32>) -> (Vec<u32>, usize) {
    let distinct = |t: &[u32; 3]| t[0] != t[1] && t[1] != t[2] && t[2] != t[0];
    match mode {
        Mode::TriangleStrip => {
            // Strips are stitched with degenerate triangles that repeat a corner; these are dropped.
            let turn = |(i, w): (usize, &[u32])| if i % 2 == 0 { [w[0], w[1], w[2]] } else { [w[0], w[2], w[1]] };
            (indices.windows(3).enumerate().map(turn).filter(distinct).flatten().collect(), 0)
        }
        Mode::TriangleFan => {
            let hub = indices.first().copied().unwrap_or(0);
            let rim = indices.get(1..).unwrap_or(&[]);
            (rim.windows(2).map(|w| [w[0], w[1], hub]).filter(distinct).flatten().collect(), 0)
        }
        _ => {
            let left_over = indices.len() % 3;
            indices.truncate(indices.len() - left_over);
            (indices, left_over)
        }
    }
}

fn morph(document: &Document<'_>, json: &json::mesh::Primitive, weights: &[f32], mesh: &mut Mesh) -> Result<()> {
    fn add<const N: usize>(values: &mut [[f32; N]], deltas: &[[f32; 3]], weight: f32) {
        for (value, delta) in values.iter_mut().zip(deltas) {
            for (x, d) in value.iter_mut().zip(delta) {
                *x += weight * d;
            }
        }
    }
    for (target, &weight) in json.targets.iter().flatten().zip(weights).filter(|(_, w)| **w != 0.0) {
        let read = |accessor: Option<json::Index<json::Accessor>>| match accessor {
            Some(accessor) => Accessor::new(document, accessor.value())?.floats::<3>(),
            None => Ok(Vec::new()),
        };
        add(&mut mesh.positions, &read(target.positions)?, weight);
        add(&mut mesh.normals, &read(target.normals)?, weight);
        add(&mut mesh.tangents, &read(target.tangents)?, weight);
    }
    Ok(())
}

/// Four joints and their weights for every vertex.
type JointSet = (Vec<[u16; 4]>, Vec<[f32; 4]>);

/// Joints and weights of every vertex: one or two sets of four.
struct Skin {
    sets: Vec<JointSet>,
    unweighted: usize,
}

fn read_skin<'d>(
    get: &impl Fn(Semantic) -> Result<Option<Accessor<'d>>>,
    vertices: usize,
    joint_count: usize,
) -> Result<Skin> {
    let mut sets = Vec::new();
    for set in 0..2 {
        let (Some(joints), Some(weights)) = (get(Semantic::Joints(set))?, get(Semantic::Weights(set))?) else {
            break;
        };
        let (joints, weights) = (joints.joints()?, weights.floats::<4>()?);
        ensure!(
            joints.len() == vertices && weights.len() == vertices,
            "it has {vertices} vertices, {} joint sets and {} weight sets",
            joints.len(),
            weights.len()
        );
        sets.push((joints, weights));
    }
    ensure!(!sets.is_empty(), "its node has a skin, but it has no JOINTS_0 and WEIGHTS_0 attributes");
    let mut unweighted = 0;
    for vertex in 0..vertices {
        let total: f32 = sets.iter().flat_map(|(_, w)| w[vertex]).sum();
        ensure!(total.is_finite(), "a joint weight of vertex {vertex} is not finite");
        for (joints, weights) in &sets {
            for (&joint, &weight) in joints[vertex].iter().zip(&weights[vertex]) {
                ensure!(
                    weight == 0.0 || usize::from(joint) < joint_count,
                    "vertex {vertex} follows joint {joint}, but the skin has {joint_count}"
                );
            }
        }
        if total <= 0.0 {
            let joint = sets[0].0[vertex][0];
            ensure!(
                usize::from(joint) < joint_count,
                "vertex {vertex} follows joint {joint}, but the skin has {joint_count}"
            );
            sets[0].1[vertex] = [1.0, 0.0, 0.0, 0.0];
            sets.iter_mut().skip(1).for_each(|(_, w)| w[vertex] = [0.0; 4]);
            unweighted += 1;
        }
    }
    Ok(Skin { sets, unweighted })
}

/// Skins a mesh into world space. Returns true if that mirrors most of it, so that the winding must be reversed.
fn bend(mesh: &mut Mesh, skin: &Skin, joints: &[DAffine3]) -> bool {
    let mut mirrored = 0_usize;
    for vertex in 0..mesh.positions.len() {
        let mut blend = DAffine3::ZERO;
        let mut total = 0.0;
        for (indices, weights) in &skin.sets {
            for (&joint, &weight) in indices[vertex].iter().zip(&weights[vertex]) {
                if weight != 0.0 {
                    let (joint, weight) = (&joints[usize::from(joint)], f64::from(weight));
                    blend.matrix3 += joint.matrix3 * weight;
                    blend.translation += joint.translation * weight;
                    total += weight;
                }
            }
        }
        // Weights stored in bytes do not add up to exactly one.
        blend.matrix3 *= 1.0 / total;
        blend.translation /= total;
        let turn = |m: DMat3, v: DVec3| (m * v).normalize_or_zero().as_vec3().to_array();
        let p = &mut mesh.positions[vertex];
        *p = blend.transform_point3(Vec3::from(*p).as_dvec3()).as_vec3().to_array();
        let sign = blend.matrix3.determinant().signum();
        mirrored += usize::from(sign < 0.0);
        if let Some(n) = mesh.normals.get_mut(vertex) {
            *n = turn(cofactors(&blend.matrix3) * sign, Vec3::from(*n).as_dvec3());
        }
        if let Some([x, y, z, w]) = mesh.tangents.get_mut(vertex) {
            [*x, *y, *z] = turn(blend.matrix3, Vec3::new(*x, *y, *z).as_dvec3());
            *w *= sign as f32;
        }
    }
    mirrored * 2 > mesh.positions.len()
}

/// Cameras with their nodes.
fn cameras(document: &Document<'_>, nodes: &Nodes, warnings: &mut Vec<String>) -> Result<Vec<(usize, Camera)>> {
    let root = &document.root;
    let mut cameras = Vec::new();
    // Invisible nodes have cameras, too (KHR_node_visibility).
    for &node in &nodes.in_scene {
        let Some(index) = root.nodes[node].camera.map(|c| c.value()) else { continue };
        let camera = &root.cameras[index];
        let place = format!("camera {index} at {}", label(document, node));
        let projection = projection(camera).with_context(|| place.clone())?;
        let Some(world_from_camera) = rigid(&nodes.world_from_node[node]) else {
            warnings.push(format!("{place}: its node is scaled to nothing, so it is left out"));
            continue;
        };
        let name = camera.name.clone().or_else(|| root.nodes[node].name.clone());
        let name = name.unwrap_or_else(|| format!("camera {index}"));
        cameras.push((node, Camera { name, world_from_camera, projection }));
    }
    Ok(cameras)
}

fn projection(camera: &json::Camera) -> Result<Projection> {
    let near = |z: f32| (z > 0.0 && z.is_finite()).then_some(f64::from(z));
    match (&camera.type_, &camera.perspective, &camera.orthographic) {
        (Checked::Valid(CameraType::Perspective), Some(p), _) => {
            ensure!(
                p.yfov > 0.0 && p.yfov < std::f32::consts::PI,
                "its field of view of {} radians does not lie between 0 and π",
                p.yfov
            );
            Ok(Projection::Perspective { fov_y: f64::from(p.yfov), near: near(p.znear) })
        }
        (Checked::Valid(CameraType::Orthographic), _, Some(o)) => {
            ensure!(o.ymag != 0.0 && o.ymag.is_finite(), "its height of {} is not possible", o.ymag);
            ensure!(
                o.znear.is_finite() && o.zfar.is_finite() && o.zfar > o.znear,
                "its depth range {} … {} is empty",
                o.znear,
                o.zfar
            );
            Ok(Projection::Orthographic {
                half_height: f64::from(o.ymag.abs()),
                near: f64::from(o.znear),
                far: f64::from(o.zfar),
            })
        }
        _ => anyhow::bail!("it lacks the numbers of its type"),
    }
}

/// Rigid part of a transform, without scale, shear and mirroring: keeps the view direction, then the up direction.
fn rigid(world_from_node: &DAffine3) -> Option<DAffine3> {
    let m = world_from_node.matrix3;
    let backward = m.z_axis.try_normalize()?;
    let right = m.y_axis.cross(backward).try_normalize()?;
    let matrix3 = DMat3::from_cols(right, backward.cross(right), backward);
    Some(DAffine3 { matrix3, translation: world_from_node.translation })
}

/// Lights with their nodes.
fn lights(document: &Document<'_>, nodes: &Nodes, warnings: &mut Vec<String>) -> Result<Vec<(usize, Light)>> {
    let root = &document.root;
    let all = root.extensions.as_ref().and_then(|e| e.khr_lights_punctual.as_ref()).map_or(&[][..], |l| &l.lights);
    let mut lights = Vec::new();
    for &node in nodes.shown.iter().filter(|&&node| !nodes.hidden[node]) {
        let Some(reference) = root.nodes[node].extensions.as_ref().and_then(|e| e.khr_lights_punctual.as_ref()) else {
            continue;
        };
        let index = reference.light.value();
        let place = format!("light {index} at {}", label(document, node));
        let json = all.get(index).with_context(|| format!("{place} does not exist; the file has {}", all.len()))?;
        let world = &nodes.world_from_node[node];
        let position = world.translation;
        let Some(direction) = (world.matrix3 * DVec3::NEG_Z).try_normalize() else {
            warnings.push(format!("{place}: its node is scaled to nothing, so it is left out"));
            continue;
        };
        let range = match json.range {
            Some(range) if range > 0.0 && range.is_finite() => Some(f64::from(range)),
            Some(range) => {
                warnings.push(format!("{place}: the range {range} is not possible and is ignored"));
                None
            }
            None => None,
        };
        let kind = match json.type_ {
            Checked::Valid(LightType::Directional) => LightKind::Directional { direction },
            Checked::Valid(LightType::Point) => LightKind::Point { position, range },
            Checked::Valid(LightType::Spot) => {
                let spot = json.spot.as_ref().with_context(|| format!("{place} is a spot without a cone"))?;
                let (inner, outer) = cone(spot.inner_cone_angle, spot.outer_cone_angle, &place, warnings);
                LightKind::Spot { position, direction, range, inner, outer }
            }
            Checked::Invalid => anyhow::bail!("{place} has an unknown type"),
        };
        let color = json.color.map(|c| (c * json.intensity).clamp(0.0, f32::MAX));
        if json.intensity < 0.0 || json.color.iter().any(|&c| c < 0.0 || !c.is_finite()) {
            warnings.push(format!("{place}: its colour or strength is negative or infinite and is clamped"));
        }
        let name = json.name.clone().or_else(|| root.nodes[node].name.clone());
        let name = name.unwrap_or_else(|| format!("light {index}"));
        let mut light = Light { name, color, spectrum: None, extent: None, kind, proxy: false };
        let found = gltf_extras::apply_to_light(&json.extras, &mut light, side(world.matrix3.x_axis, direction))
            .with_context(|| place.clone())?;
        warnings.extend(found.into_iter().map(|warning| format!("{place}: {warning}")));
        lights.push((node, light));
    }
    Ok(lights)
}

/// The unit vector perpendicular to a unit axis that is nearest to `x`.
fn side(x: DVec3, axis: DVec3) -> DVec3 {
    let x = x.normalize_or_zero();
    (x - axis * x.dot(axis)).try_normalize().unwrap_or_else(|| axis.any_orthonormal_vector())
}

/// Clamps cone angles to `0 ≤ inner < outer ≤ π/2`.
fn cone(inner: f32, outer: f32, place: &str, warnings: &mut Vec<String>) -> (f64, f64) {
    const SMALLEST: f64 = 1e-4;
    let (inner_asked, outer_asked) = (f64::from(inner), f64::from(outer));
    // The default of π/4 and a full half-turn are stored in f32, which may lie above the f64 limit.
    let outer = outer_asked.clamp(SMALLEST, std::f64::consts::FRAC_PI_2);
    let inner = inner_asked.clamp(0.0, outer - SMALLEST);
    if (inner - inner_asked).abs() > 1e-3 || (outer - outer_asked).abs() > 1e-3 {
        warnings.push(format!("{place}: the cone {inner_asked} … {outer_asked} is not possible and is clamped"));
    }
    (inner, outer)
}
