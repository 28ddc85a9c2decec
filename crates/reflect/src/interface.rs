//! Shader interface: declarations without numbers, and the ids, sets and slots that they are assigned.
//!
//! ```text
//! layout(constant) const uint BRDF = 2;                               specialization constant
//! layout(pass, rgba32f) uniform image2D radiance;                     set 0: pushed with each dispatch or draw
//! layout(scene, rgba32f) readonly uniform imageBuffer lights;         set 1: written once per renderer
//! layout(pages) uniform sampler2DArray base_page;                     set 2: written once per combination of textures
//! layout(paths, rgba32ui) readonly uniform uimageBuffer emitters;     set 2 of paths: written once per renderer
//! const uint SHAPE_SPHERE = 1;                                        shared with the host
//! ```
//!
//! A struct of `shaders/share/` in a texel buffer view is read by a function that the build generates:
//!
//! ```text
//! // @texels Material material_at(material_words)        material_words(uint index, int texel) fetches a uvec4
//! // @texels BvhTriangle triangle_at(bvh_triangles)      of a binding that holds only such structs
//! // @texels Material.sigma material_sigma(...)          one member alone
//! ```
//!
//! A page is a texture of a material with its slot: SLOT_BASE is the number of `base_page`. `// @pages SLOTS` counts
//! the pages.
//!
//! A member whose comment begins with `where CONSTANT` is omitted when that constant is false; such a struct is read
//! member by member.
//!
//! A declaration is one line. Constants, and bindings of all sets but a pass's own, have one number in all programs,
//! and one file that declares them. Bindings of a pass are numbered from 0 in each program.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use super::files::{Result, files, snake, stem};
use super::reflect::{Member, Struct};

/// Kinds of descriptor sets with their set numbers. A program reads `pages` or `paths`, never both.
pub(crate) const SETS: [(&str, u32); 4] = [("pass", 0), ("scene", 1), ("pages", 2), ("paths", 2)];

/// Tag of the line that is replaced by the number of pages.
const PAGE_COUNT: &str = "// @pages ";

/// A constant shared with the host: `const uint NAME = 3;`, and in `shaders/share/` `const float NAME = 1.5;`.
pub(crate) struct Shared {
    pub(crate) name: String,
    /// Rust type.
    pub(crate) ty: &'static str,
    pub(crate) value: String,
    /// The comment after the declaration.
    pub(crate) about: String,
}

/// A declaration.
pub(crate) struct Declaration {
    /// `constant`, or one of [`SETS`].
    pub(crate) kind: String,
    pub(crate) name: String,
    /// The comment after the declaration.
    pub(crate) about: String,
}

/// Declarations of one file.
pub(crate) struct File {
    pub(crate) stem: String,
    /// Folder under `shaders/`.
    pub(crate) folder: &'static str,
    /// The first line of the file, without slashes.
    pub(crate) about: String,
    pub(crate) declarations: Vec<Declaration>,
    pub(crate) shared: Vec<Shared>,
    /// The constant that counts the pages, if this file declares it.
    page_count: Option<String>,
}

/// Declarations of all files, with the numbers that are common to all programs.
pub(crate) struct Interface {
    root: PathBuf,
    pub(crate) files: Vec<File>,
    constants: BTreeMap<String, u32>,
    slots: BTreeMap<String, u32>,
    /// Members of the structs of `shaders/share/`.
    structs: BTreeMap<String, Vec<Field>>,
}

/// A member declaration of a struct.
struct Field {
    ty: String,
    name: String,
    /// Constant; the member is omitted when it is false.
    condition: Option<String>,
}

/// Slot and file of each binding in a program's own set.
pub(crate) type PassSlots = BTreeMap<String, (u32, String)>;

impl Interface {
    pub(crate) fn read(root: &Path) -> Result<Self> {
        let mut all = Self {
            root: root.to_owned(),
            files: Vec::new(),
            constants: BTreeMap::new(),
            slots: BTreeMap::new(),
            structs: BTreeMap::new(),
        };
        let mut owners: BTreeMap<String, String> = BTreeMap::new();
        for folder in ["share", "lib", "pass"] {
            for path in files(&root.join(folder))? {
                let text = fs::read_to_string(&path).map_err(|e| format!("reading {}: {e}", path.display()))?;
                let file = file(&path, folder, &text)?;
                if folder == "share" {
                    all.structs.extend(structs(&text));
                }
                for Declaration { kind, name, .. } in &file.declarations {
                    if kind == "pass" {
                        continue;
                    }
                    let place = path.display().to_string();
                    let known = owners.insert(format!("{kind} {}", base(name)), place.clone());
                    if let Some(other) = known.filter(|other| *other != place) {
                        return Err(format!("{place}: {name} is declared in {other} already"));
                    }
                    let numbers = if kind == "constant" { &mut all.constants } else { &mut all.slots };
                    let known = numbers.insert(base(name).to_owned(), 0);
                    let of_other_set = SETS[1..]
                        .iter()
                        .any(|(set, _)| set != kind && owners.contains_key(&format!("{set} {}", base(name))));
                    if known.is_some() && of_other_set {
                        return Err(format!("{place}: {name} is the name of a binding in another set"));
                    }
                }
                all.files.push(file);
            }
        }
        for (number, id) in all.constants.values_mut().enumerate() {
            *id = number as u32;
        }
        // Sets of one number share slots: a program may include a file whose declarations it never reads.
        let mut next: BTreeMap<u32, u32> = BTreeMap::new();
        for (set, number) in &SETS[1..] {
            let of_set = |name: &String| owners.contains_key(&format!("{set} {name}"));
            let next = next.entry(*number).or_default();
            for (_, slot) in all.slots.iter_mut().filter(|(name, _)| of_set(name)) {
                *slot = *next;
                *next += 1;
            }
        }
        let pages = all.files.iter().flat_map(|file| &file.declarations).filter(|d| d.kind == "pages").count();
        for file in &mut all.files {
            let counts = file.page_count.iter();
            file.shared.extend(counts.map(|name| Shared {
                name: name.clone(),
                ty: "u32",
                value: pages.to_string(),
                about: "Textures that a material may have.".to_owned(),
            }));
            let pages = file.declarations.iter().filter(|d| d.kind == "pages");
            let slots = pages.map(|d| (page_slot(&d.name), all.slots[&d.name], &d.about));
            let constants = slots.map(|(name, slot, about)| {
                let about = if about.is_empty() { format!("Slot of a texture: `{name}`.") } else { about.clone() };
                Shared { name, ty: "u32", value: slot.to_string(), about }
            });
            file.shared.extend(constants.collect::<Vec<_>>());
        }
        Ok(all)
    }

    /// The file that declares a constant or a shared binding.
    pub(crate) fn owner(&self, kind: &str, name: &str) -> Option<&File> {
        let declares = |file: &&File| file.declarations.iter().any(|d| d.kind == kind && base(&d.name) == name);
        self.files.iter().find(declares)
    }

    /// The kind of set of a shared binding.
    pub(crate) fn set_of(&self, name: &str) -> &'static str {
        SETS[1..].iter().find(|(set, _)| self.owner(set, name).is_some()).map_or("", |(set, _)| set)
    }

    /// The number of a specialization constant.
    pub(crate) fn constant(&self, name: &str) -> u32 {
        self.constants[name]
    }

    /// The slot of a shared binding.
    pub(crate) fn slot(&self, name: &str) -> u32 {
        self.slots[name]
    }

    /// Numbers the bindings of a program's own set, in the order of declaration in its sources and their includes.
    pub(crate) fn pass_slots(&self, texts: &[(String, String)]) -> Result<PassSlots> {
        let mut slots = PassSlots::new();
        let mut seen = Vec::new();
        for (name, text) in texts {
            self.number(name, text, &mut slots, &mut seen)?;
        }
        Ok(slots)
    }

    fn number(&self, owner: &str, text: &str, slots: &mut PassSlots, seen: &mut Vec<String>) -> Result<()> {
        for line in text.lines() {
            if let Some(included) = line.strip_prefix("#include \"").and_then(|rest| rest.split('"').next()) {
                if seen.iter().any(|known| known == included) {
                    continue;
                }
                seen.push(included.to_owned());
                let path = self.root.join(included);
                let text = fs::read_to_string(&path).map_err(|e| format!("{owner} includes \"{included}\": {e}"))?;
                self.number(&stem(&path), &text, slots, seen)?;
            }
            if let Some(Declaration { kind, name, .. }) = declaration(line).filter(|d| d.kind == "pass") {
                let name = base(&name).to_owned();
                let next = slots.len() as u32;
                let (_, known) = slots.entry(name.clone()).or_insert_with(|| (next, owner.to_owned()));
                if known != owner {
                    return Err(format!("{owner}: {kind} binding {name} is declared in {known} already"));
                }
            }
        }
        Ok(())
    }

    /// Inserts the numbers into a source text. Constants in `without` become ordinary constants, false or 0, so that
    /// the compiler removes the code they guard.
    pub(crate) fn numbered(&self, text: &str, slots: &PassSlots, without: &[String]) -> Result<String> {
        let mut out = String::with_capacity(text.len() + 1024);
        for line in text.lines() {
            if let Some(tag) = line.strip_prefix("// @texels ") {
                out += &self.reader(tag)?;
                out.push('\n');
                continue;
            }
            if let Some(name) = line.strip_prefix(PAGE_COUNT) {
                let pages = self.files.iter().flat_map(|file| &file.declarations).filter(|d| d.kind == "pages");
                out += &format!("const uint {name} = {};\n", pages.count());
                continue;
            }
            match declaration(line) {
                Some(Declaration { kind, name, .. }) if kind == "constant" => {
                    let (_, rest) = line.split_once(") ").unwrap_or_default();
                    if without.contains(&name) {
                        let (head, _) = rest.split_once(" = ").unwrap_or_default();
                        let value = if head.starts_with("const bool ") { "false" } else { "0" };
                        out += &format!("{head} = {value};");
                    } else {
                        out += &format!("layout(constant_id = {}) {rest}", self.constants[&name]);
                    }
                }
                Some(Declaration { kind, name, .. }) => {
                    let set = SETS.iter().find(|(set, _)| *set == kind).map_or(0, |(_, number)| *number);
                    let shared = || self.slots.get(base(&name)).copied();
                    let own = || slots.get(base(&name)).map(|(slot, _)| *slot);
                    let slot = if set == 0 { own() } else { shared() };
                    let slot = slot.ok_or_else(|| format!("{name}: a binding that nobody has numbered"))?;
                    let layout = format!("layout({kind}");
                    if kind == "pages" {
                        out += &format!("const uint {} = {slot}; ", page_slot(&name));
                    }
                    out += &line.replacen(&layout, &format!("layout(set = {set}, binding = {slot}"), 1);
                }
                None => out += line,
            }
            out.push('\n');
        }
        Ok(out)
    }
}

impl Interface {
    /// Generates the function of a tag `Material material_at(material_words)`, which reads a struct or a member from
    /// texels of four words. It is one line, so that line numbers in compiler messages stay correct.
    fn reader(&self, tag: &str) -> Result<String> {
        let wrong = || format!("// @texels {tag}: expected `STRUCT FUNCTION(FETCH)`, of a struct of shaders/share/");
        let (what, rest) = tag.split_once(' ').ok_or_else(wrong)?;
        let (name, fetch) =
            rest.trim_end().strip_suffix(')').and_then(|rest| rest.split_once('(')).ok_or_else(wrong)?;
        let (record, member) = what.split_once('.').map_or((what, None), |(record, member)| (record, Some(member)));
        let fields = self.structs.get(record).ok_or_else(wrong)?;
        let at = match member {
            Some(member) => fields.iter().position(|field| field.name == member).ok_or_else(wrong)?,
            None if fields.iter().any(|field| field.condition.is_some()) => {
                return Err(format!("// @texels {tag}: members that may be left out are read one by one"));
            }
            None => 0,
        };
        let ty = member.map_or(record, |_| &fields[at].ty);
        let (before, optional_before) = self.size(&fields[..at])?;
        let (first, mut word) = (before / 4, before % 4);
        let value = self.value(ty, &mut word)?;
        let (words, optional) = self.size(fields)?;
        if self.slots.contains_key(fetch) && words % 4 != 0 {
            return Err(format!("// @texels {tag}: {record} ends within a texel"));
        }
        let load = |i: usize| {
            let texel = format!("{}{optional_before}", first + i);
            match self.slots.contains_key(fetch) {
                true => format!("imageLoad({fetch}, int(index) * ({}{optional}) + {texel})", words / 4),
                false => format!("{fetch}(index, {texel})"),
            }
        };
        let texels: String = (0..word.div_ceil(4)).map(|i| format!("uvec4 t{i} = {}; ", load(i))).collect();
        Ok(format!("{ty} {name}(uint index) {{ {texels}return {value}; }}"))
    }

    /// Words of the unconditional members, and a GLSL expression for texels of conditional ones:
    /// ` + (CONSTANT ? 2 : 0)`.
    fn size(&self, fields: &[Field]) -> Result<(usize, String)> {
        let (mut words, mut optional) = (0, String::new());
        for Field { ty, name, condition } in fields {
            let mut size = 0;
            self.value(ty, &mut size)?;
            match condition {
                Some(_) if size % 4 != 0 || words % 4 != 0 => {
                    return Err(format!("{ty} {name}: what may be left out is of whole texels"));
                }
                Some(condition) => optional += &format!(" + ({condition} ? {} : 0)", size / 4),
                None => words += size,
            }
        }
        Ok((words, optional))
    }

    /// GLSL expression for the value that begins at the word `word` of the texels t0, t1 ...:
    /// `uintBitsToFloat(t0.xyz)`.
    fn value(&self, ty: &str, word: &mut usize) -> Result<String> {
        if let Some(fields) = self.structs.get(ty) {
            let members = fields.iter().map(|field| self.value(&field.ty, word)).collect::<Result<Vec<_>>>()?;
            return Ok(format!("{ty}({})", members.join(", ")));
        }
        let (scalar, count) = scalars(ty).ok_or_else(|| format!("// @texels: no texels for {ty}"))?;
        let words: Vec<usize> = (*word..*word + count).collect();
        *word += count;
        let letter = |w: &usize| ["x", "y", "z", "w"][w % 4];
        // One swizzle if all words are in one texel.
        let bits = match words[0] / 4 == words[count - 1] / 4 {
            true => format!("t{}.{}", words[0] / 4, words.iter().map(letter).collect::<String>()),
            false => {
                let each: Vec<_> = words.iter().map(|w| format!("t{}.{}", w / 4, letter(w))).collect();
                format!("uvec{count}({})", each.join(", "))
            }
        };
        Ok(match scalar {
            "f32" => format!("uintBitsToFloat({bits})"),
            "i32" => format!("{ty}({bits})"),
            _ => bits,
        })
    }

    /// A struct that has conditional members, with all of them present: shaders never read it whole.
    pub(crate) fn with_all_members(&self, name: &str) -> Result<Option<Struct>> {
        let Some(fields) = self.structs.get(name) else { return Ok(None) };
        if fields.iter().all(|field| field.condition.is_none()) {
            return Ok(None);
        }
        let (mut words, mut members) = (0, Vec::new());
        for Field { ty, name, .. } in fields {
            let rust = match scalars(ty) {
                None => ty.clone(),
                Some((scalar, 1)) => scalar.to_owned(),
                Some((scalar, count)) => format!("[{scalar}; {count}]"),
            };
            members.push(Member { name: name.clone(), ty: rust, offset: 4 * words as u32 });
            self.value(ty, &mut words)?;
        }
        Ok(Some(Struct { name: name.to_owned(), members, size: 4 * words as u32 }))
    }
}

/// Component type in Rust, and number of components, of a scalar or a vector.
fn scalars(ty: &str) -> Option<(&'static str, usize)> {
    let count = |digits: &str| digits.parse().ok().filter(|n| (2..=4).contains(n));
    match ty {
        "float" => Some(("f32", 1)),
        "uint" => Some(("u32", 1)),
        "int" => Some(("i32", 1)),
        _ => [("vec", "f32"), ("uvec", "u32"), ("ivec", "i32")]
            .iter()
            .find_map(|(vector, scalar)| Some((*scalar, count(ty.strip_prefix(vector)?)?))),
    }
}

/// Structs of a file; each member is on its own line.
fn structs(text: &str) -> BTreeMap<String, Vec<Field>> {
    let mut all = BTreeMap::new();
    let mut open: Option<(String, Vec<Field>)> = None;
    for line in text.lines() {
        let (code, about) = comment(line);
        if let Some(rest) = code.strip_prefix("struct ") {
            open = Some((rest.trim_end_matches(['{', ' ']).to_owned(), Vec::new()));
        } else if code.starts_with("};") {
            all.extend(open.take());
        } else if let Some((_, members)) = &mut open
            && let Some((ty, name)) = code.trim().trim_end_matches(';').split_once(' ')
        {
            let word = |text: &str| text.split(|c: char| !c.is_alphanumeric() && c != '_').next().map(str::to_owned);
            let condition = about.strip_prefix("where ").and_then(word);
            members.push(Field { ty: ty.to_owned(), name: name.to_owned(), condition });
        }
    }
    all
}

/// The constant of a page: `SLOT_BASE` of `base_page`.
fn page_slot(name: &str) -> String {
    format!("SLOT_{}", name.trim_end_matches("_page").to_uppercase())
}

/// The binding NAME of `NAME_as_FORMAT`, which reads it in another format.
fn base(name: &str) -> &str {
    name.split_once("_as_").map_or(name, |(of, _)| of)
}

fn file(path: &Path, folder: &'static str, text: &str) -> Result<File> {
    let about = text.lines().next().unwrap_or_default().trim_start_matches('/').trim().to_owned();
    let page_count = text.lines().find_map(|line| line.strip_prefix(PAGE_COUNT)).map(str::to_owned);
    let mut file = File { stem: stem(path), folder, about, declarations: Vec::new(), shared: Vec::new(), page_count };
    for (number, line) in text.lines().enumerate() {
        if ["set =", "binding =", "constant_id"].iter().any(|word| line.starts_with("layout(") && line.contains(word)) {
            return Err(format!(
                "{}:{}: numbers of bindings and constants are the build's",
                path.display(),
                number + 1
            ));
        }
        file.declarations.extend(declaration(line));
        // Integer constants of `lib/` are shared with the host, other constants only in `share/`.
        file.shared.extend(shared(line).filter(|constant| constant.ty != "f32" || folder == "share"));
    }
    Ok(file)
}

fn comment(line: &str) -> (&str, String) {
    line.split_once("//").map_or((line, String::new()), |(code, about)| (code, about.trim().to_owned()))
}

fn declaration(line: &str) -> Option<Declaration> {
    let rest = line.strip_prefix("layout(")?;
    let (inside, _) = rest.split_once(')')?;
    let kind = inside.split(',').next()?.trim();
    if kind != "constant" && !SETS.iter().any(|(set, _)| *set == kind) {
        return None;
    }
    let (code, about) = comment(line);
    let word =
        |text: &str| text.rsplit(|c: char| !c.is_alphanumeric() && c != '_').find(|w| !w.is_empty()).map(str::to_owned);
    let name = if kind == "constant" {
        word(code.split_once(" = ")?.0)?
    } else if let Some((block, instance)) = code.split_once('{').zip(code.rsplit_once('}')).map(|(a, b)| (a.0, b.1)) {
        // A block without an instance name has the name of its type.
        word(instance).or_else(|| Some(snake(&word(block)?)))?
    } else {
        word(code.split(';').next()?)?
    };
    Some(Declaration { kind: kind.to_owned(), name, about })
}

/// Parses a constant of one number.
fn shared(line: &str) -> Option<Shared> {
    let (code, about) = comment(line);
    let (head, value) = code.strip_prefix("const ")?.split_once(" = ")?;
    let (ty, name) = head.split_once(' ')?;
    let value = value.trim().strip_suffix(';')?.trim_end_matches(['u', 'U']);
    let integer = |text: &str| match text.strip_prefix("0x") {
        Some(digits) => u32::from_str_radix(digits, 16).is_ok(),
        None => text.parse::<i64>().is_ok(),
    };
    let ty = match ty {
        "uint" if integer(value) => "u32",
        "int" if integer(value) => "i32",
        "float" if value.parse::<f32>().is_ok() => "f32",
        _ => return None,
    };
    Some(Shared { name: name.to_owned(), ty, value: value.to_owned(), about })
}
