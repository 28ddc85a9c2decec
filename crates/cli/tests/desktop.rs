//! The files of `etalon desktop`, as desktops use them: the entry and the types by their own tools, the thumbnailer by
//! its line.

#[path = "support/program.rs"]
mod program;

use std::path::Path;
use std::process::Command;

use etalon::image::png;
use etalon_cli::desktop::ID;
use etalon_testing::gltf_builder::Builder;
use program::{HASTY, etalon};
use serde_json::json;

/// Runs a tool of the desktop on these files; `None`, with a message, where it is not installed.
fn tool(name: &str, arguments: &[&Path]) -> Option<String> {
    match Command::new(name).args(arguments).output() {
        Ok(output) => {
            let said = format!("{output:?}");
            assert!(output.status.success(), "{name}: {said}");
            Some(said)
        }
        Err(error) => {
            eprintln!("{name} is not run: {error}");
            None
        }
    }
}

#[test]
fn desktops_accept_the_files() {
    let folder = tempfile::tempdir().expect("a folder");
    let run = etalon(folder.path(), &["desktop", "-o", "local"], &[]).succeeded();
    let files: Vec<&Path> = run.stdout.lines().map(Path::new).collect();
    let share = folder.path().join("local/share");
    let entry = share.join(format!("applications/{ID}.desktop"));
    for file in [&entry, &share.join(format!("thumbnailers/{ID}.thumbnailer"))] {
        assert!(file.is_file() && files.iter().any(|listed| file.ends_with(listed)), "{}: {run:?}", file.display());
    }
    for side in [16, 256] {
        let icon = share.join(format!("icons/hicolor/{side}x{side}/apps/{ID}.png"));
        let icon = png::read_display(&icon).expect("an icon");
        assert_eq!((icon.width, icon.height), (side, side));
    }
    if let Some(said) = tool("desktop-file-validate", &[&entry]) {
        assert!(!said.contains("warning") && !said.contains("hint"), "{said}");
    }
    let mime = share.join("mime");
    if tool("update-mime-database", &[&mime]).is_some() {
        let globs = std::fs::read_to_string(mime.join("globs2")).expect("the database of types");
        for line in ["model/gltf-binary:*.glb", "model/gltf+json:*.gltf", "model/obj:*.obj", "model/x-ply:*.ply"] {
            assert!(globs.lines().any(|known| known.ends_with(line)), "{line}: {globs}");
        }
    }
    // A second run replaces the files.
    etalon(folder.path(), &["-q", "desktop", "-o", "local"], &[]).succeeded();
    etalon(folder.path(), &["desktop", "-o", "local/share/applications/etalon.desktop"], &[]).failed(1, "folder");
}

#[test]
fn the_thumbnailer_draws_a_model() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = folder.path();
    let mut model = Builder::new();
    let position = model.triangle();
    let mesh = model.mesh(json!({ "attributes": { "POSITION": position } }));
    model.root(json!({ "mesh": mesh }));
    model.save_glb(at);
    std::fs::rename(at.join("scene.glb"), at.join("a model.glb")).expect("another name");
    etalon(at, &["-q", "desktop", "-o", "."], &[]).succeeded();
    let text = std::fs::read_to_string(at.join(format!("share/thumbnailers/{ID}.thumbnailer"))).expect("a file");
    let line = text.lines().find_map(|line| line.strip_prefix("Exec=etalon ")).expect("a command");
    // Codes are replaced within each word: names of files may contain spaces.
    let [input, output] = ["a model.glb", "thumbnail.3XQ2"].map(|name| at.join(name).display().to_string());
    let codes = [("%i", input.as_str()), ("%o", &output), ("%s", "128")];
    let word = |word: &str| codes.iter().fold(word.to_owned(), |word, (code, value)| word.replace(code, value));
    let words: Vec<String> = line.split(' ').map(word).collect();
    let run = etalon(at, &words.iter().map(String::as_str).collect::<Vec<_>>(), &HASTY).succeeded();
    assert_eq!(run.stderr, "", "{run:?}");
    let drawn = png::read_display(Path::new(&output)).expect("a PNG");
    assert_eq!((drawn.width, drawn.height), (128, 128));
    assert!(drawn.rgba.iter().any(|pixel| pixel[3] == 0) && drawn.rgba.iter().any(|pixel| pixel[3] == 255));
}
