//! `etalon desktop`: the files by which a desktop opens models with Etalon and shows thumbnails of them.
//!
//! Read the freedesktop specifications: desktop entries, shared MIME info, icon themes.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::{Context as _, Result};
use clap::Args;
use maud::{PreEscaped, html};

use super::{icon, print};
use etalon::image::{file, png};

/// Name of the desktop entry and of the icon. A window with this application id (Wayland) and class (X11) gets both.
pub const ID: &str = "etalon";

/// Sides of the icon's pictures, in pixels: those that themes have folders for.
const ICON_SIDES: [u32; 8] = [16, 24, 32, 48, 64, 128, 256, 512];

/// A file format as desktops know it.
struct MimeType {
    name: &'static str,
    extension: &'static str,
    about: &'static str,
    /// Another name of the same type.
    alias: Option<&'static str>,
}

/// The formats that are read. The names are those of shared-mime-info, which has none for PLY: there they are the most
/// common ones.
const TYPES: [MimeType; 5] = [
    MimeType { name: "model/gltf-binary", extension: "glb", about: "glTF model", alias: None },
    MimeType { name: "model/gltf+json", extension: "gltf", about: "glTF model", alias: None },
    MimeType { name: "model/obj", extension: "obj", about: "OBJ 3D model", alias: None },
    MimeType { name: "model/stl", extension: "stl", about: "STL 3D model", alias: None },
    MimeType { name: "model/x-ply", extension: "ply", about: "PLY 3D model", alias: Some("application/vnd.ply") },
];

/// Write the files by which a desktop opens models with Etalon and shows thumbnails of them: a desktop entry, MIME
/// types, icons and a thumbnailer
#[derive(Debug, Clone, Args)]
#[command(after_help = "\
Examples:
    etalon desktop -o desktop-files

`etalon desktop -o ~/.local` installs them for one user. The program itself has to be in PATH.")]
pub struct DesktopArgs {
    /// The folder that gets share/applications, share/mime, share/icons and share/thumbnailers
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
}

/// Runs the command.
///
/// # Errors
/// When a file cannot be written.
pub fn run(args: &DesktopArgs, quiet: bool) -> Result<ExitCode> {
    let share = args.output.join("share");
    for (name, bytes) in files()? {
        let path = share.join(name);
        let folder = path.parent().unwrap_or(&share);
        std::fs::create_dir_all(folder).with_context(|| format!("creating the folder {}", folder.display()))?;
        file::write(&path, &bytes)?;
        print(&path.display().to_string())?;
    }
    if !quiet {
        eprintln!("{}", refresh(&share));
    }
    Ok(ExitCode::SUCCESS)
}

/// The commands by which a desktop takes note of the files.
fn refresh(share: &Path) -> String {
    let share = share.display();
    format!(
        "a desktop reads these below ~/.local/share or /usr/share; to tell it about them there:\n    \
         update-mime-database {share}/mime\n    update-desktop-database {share}/applications"
    )
}

/// All files, with their paths below `share`.
fn files() -> Result<Vec<(String, Vec<u8>)>> {
    let mut all = vec![
        (format!("applications/{ID}.desktop"), entry().into_bytes()),
        (format!("mime/packages/{ID}.xml"), mime_types().into_bytes()),
        (format!("thumbnailers/{ID}.thumbnailer"), thumbnailer().into_bytes()),
        (format!("icons/hicolor/scalable/apps/{ID}.svg"), icon::svg().into_bytes()),
    ];
    for side in ICON_SIDES {
        let path = format!("icons/hicolor/{side}x{side}/apps/{ID}.png");
        all.push((path, png::encode_png(side, side, &icon::pixels(side), true)?));
    }
    Ok(all)
}

/// The value of a key `MimeType`.
fn type_names() -> String {
    TYPES.iter().map(|mime| format!("{};", mime.name)).collect()
}

fn entry() -> String {
    format!(
        "[Desktop Entry]\n\
         Type=Application\n\
         Version=1.5\n\
         Name=Etalon\n\
         GenericName=3D Model Viewer\n\
         Comment=Look at glTF, OBJ, STL and PLY models\n\
         Exec=etalon view %f\n\
         TryExec=etalon\n\
         Icon={ID}\n\
         Terminal=false\n\
         Categories=Graphics;3DGraphics;Viewer;\n\
         Keywords=3D;model;scene;glTF;GLB;OBJ;STL;PLY;Vulkan;\n\
         MimeType={}\n\
         StartupWMClass={ID}\n",
        type_names()
    )
}

/// A thumbnail is quick, and shows the model alone. The name of the output has no extension on some desktops.
fn thumbnailer() -> String {
    format!(
        "[Thumbnailer Entry]\n\
         TryExec=etalon\n\
         Exec=etalon render -q %i -o %o --format png --size %sx%s --model local --background transparent\n\
         MimeType={}\n",
        type_names()
    )
}

/// Of two types with the same glob the heavier one counts; 50 is the usual weight. On many desktops `*.obj` is also a
/// drawing of Tgif.
const WEIGHT: u8 = 60;

fn mime_types() -> String {
    html! {
        (PreEscaped("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n"))
        mime-info xmlns="http://www.freedesktop.org/standards/shared-mime-info" {
            @for mime in &TYPES {
                (PreEscaped("\n  "))
                mime-type type=(mime.name) {
                    comment { (mime.about) }
                    @if let Some(alias) = mime.alias { alias type=(alias) {} }
                    glob pattern={ "*." (mime.extension) } weight=(WEIGHT) {}
                }
            }
            (PreEscaped("\n"))
        }
        (PreEscaped("\n"))
    }
    .into_string()
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use etalon::scene::EXTENSIONS;

    use super::*;

    /// The keys of a file of one group.
    fn keys(text: &str, group: &str) -> BTreeMap<String, String> {
        let mut lines = text.lines();
        assert_eq!(lines.next(), Some(format!("[{group}]").as_str()));
        let key = |line: &str| line.split_once('=').map(|(key, value)| (key.to_owned(), value.to_owned()));
        let all: Vec<_> = lines.map(|line| key(line).unwrap_or_else(|| panic!("{line} has no value"))).collect();
        let count = all.len();
        let keys: BTreeMap<_, _> = all.into_iter().collect();
        assert_eq!(keys.len(), count, "a key stands twice");
        keys
    }

    #[test]
    fn entries_have_their_keys() {
        let entry = keys(&entry(), "Desktop Entry");
        assert_eq!((&*entry["Type"], &*entry["Icon"], &*entry["StartupWMClass"]), ("Application", ID, ID));
        assert!(entry["Exec"].ends_with(" %f") && !entry["Name"].is_empty());
        let thumbnailer = keys(&thumbnailer(), "Thumbnailer Entry");
        for code in ["%i", "%o", "%s"] {
            assert!(thumbnailer["Exec"].contains(code), "{thumbnailer:?}");
        }
        for lists in [&entry["MimeType"], &thumbnailer["MimeType"], &entry["Categories"], &entry["Keywords"]] {
            assert!(lists.ends_with(';'), "{lists}");
        }
        assert_eq!(entry["MimeType"], thumbnailer["MimeType"]);
        // What is started by one name must be found by it.
        for keys in [&entry, &thumbnailer] {
            assert_eq!(keys["Exec"].split(' ').next(), Some(&*keys["TryExec"]));
        }
    }

    #[test]
    fn every_format_that_is_read_has_a_type() {
        let xml = mime_types();
        let document = roxmltree::Document::parse(&xml).expect("XML");
        let types: Vec<_> = document.root_element().children().filter(roxmltree::Node::is_element).collect();
        assert!(document.root_element().tag_name().name() == "mime-info" && types.len() == TYPES.len(), "{xml}");
        let mut globs: Vec<_> = document.descendants().filter_map(|node| node.attribute("pattern")).collect();
        let mut expected: Vec<String> = EXTENSIONS.iter().map(|extension| format!("*.{extension}")).collect();
        expected.sort();
        globs.sort_unstable();
        assert_eq!(globs, expected);
        for node in types {
            let name = node.attribute("type").expect("a type");
            assert!(type_names().split(';').any(|listed| listed == name), "{name}");
        }
    }
}
