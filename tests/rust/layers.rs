//! The order of the layers: a module uses only modules that stand above it in the table of `lib.rs`.

use std::fs;
use std::path::{Path, PathBuf};

/// From the ground up; `cost` stands beside `simulation` and reads its records.
const LAYERS: [&str; 12] = [
    "error",
    "cancel",
    "width",
    "lanes",
    "game",
    "riccati",
    "network",
    "synthesis",
    "policy",
    "simulation",
    "cost",
    "ensemble",
];

fn sources(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).expect("a source folder") {
        let path = entry.expect("an entry").path();
        if path.is_dir() {
            sources(&path, found);
        } else if path.extension().is_some_and(|e| e == "rs") {
            found.push(path);
        }
    }
}

#[test]
fn a_layer_uses_only_layers_above_it() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut files = Vec::new();
    sources(&root, &mut files);
    let mut checked = 0;
    for file in files {
        let relative = file.strip_prefix(&root).expect("inside src");
        let layer = relative.components().next().expect("a name").as_os_str().to_string_lossy().replace(".rs", "");
        let Some(own) = LAYERS.iter().position(|&l| l == layer) else {
            assert_eq!(layer, "lib", "{} belongs to no layer", relative.display());
            continue;
        };
        let text = fs::read_to_string(&file).expect("a readable source");
        for part in text.split("crate::").skip(1) {
            let name: String = part.chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect();
            let used = LAYERS.iter().position(|&l| l == name);
            assert!(
                used.is_some_and(|used| used <= own),
                "{} ({layer}) uses crate::{name}, which does not stand above it",
                relative.display()
            );
            checked += 1;
        }
    }
    assert!(checked > 30, "only {checked} uses found: is the test still looking at the sources?");
}

#[test]
fn the_core_knows_nothing_of_python() {
    let manifest = fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("Cargo.toml")).expect("a manifest");
    assert!(!manifest.contains("pyo3") && !manifest.contains("numpy"));
}

/// Threads share data by safe Rust alone, so that the compiler has proved the absence of races: raw pointers cannot be
/// shared unless a type says of itself that it can, and nothing here does. What is unsafe are vector instructions.
#[test]
fn nothing_unsafe_is_shared_between_threads() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut files = Vec::new();
    sources(&root, &mut files);
    let mut wide = 0;
    for file in files {
        let text = fs::read_to_string(&file).expect("a readable source");
        let code: Vec<&str> = text.lines().filter(|line| !line.trim_start().starts_with("//")).collect();
        for word in ["unsafe impl", "static mut", "UnsafeCell", "transmute"] {
            assert!(!code.iter().any(|line| line.contains(word)), "{}: {word}", file.display());
        }
        wide += usize::from(code.iter().any(|line| line.contains("unsafe {")));
    }
    assert!(wide > 0, "no unsafe block found: is the test still looking at the sources?");
}
