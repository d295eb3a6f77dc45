//! The order of the layers: a module uses only modules that stand above it in the table of `lib.rs`, and inside the
//! synthesis only those above it in the table of `synthesis/mod.rs`.

use std::fs;
use std::path::{Path, PathBuf};

/// From the ground up; `cost` stands beside `simulation` and reads its records.
const LAYERS: [&str; 14] = [
    "error",
    "cancel",
    "memory",
    "simd",
    "random",
    "game",
    "riccati",
    "network",
    "synthesis",
    "policy",
    "simulation",
    "cost",
    "ensemble",
    "cells",
];

/// The modules of the synthesis from the ground up, and the layers that each may use.
const SYNTHESIS: [(&str, &[&str]); 3] = [
    ("newton", &["error", "cancel", "memory", "simd"]),
    ("theta", &["error", "cancel", "memory", "simd", "game"]),
    ("search", &["error", "cancel", "memory", "simd", "game", "network"]),
];

/// Every source of the core, with its path from the root of its crate: the kernels, a crate of their own, have modules
/// of the same names.
fn core() -> Vec<(PathBuf, PathBuf)> {
    let roots = ["src", "../tadcore-kernels/src"].map(|root| Path::new(env!("CARGO_MANIFEST_DIR")).join(root));
    let mut all = Vec::new();
    for root in roots {
        let mut files = Vec::new();
        sources(&root, &mut files);
        all.extend(files.into_iter().map(|file| {
            let relative = file.strip_prefix(&root).expect("inside src").to_owned();
            (file, relative)
        }));
    }
    all
}

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

/// The module that a file is, from the root of the crate: `synthesis/newton/tile.rs` → synthesis, newton, tile.
fn module(relative: &Path) -> Vec<String> {
    let path = relative.with_extension("");
    let names = path.components().map(|name| name.as_os_str().to_string_lossy().into_owned());
    names.filter(|name| name != "mod" && name != "lib").collect()
}

/// The paths that a source text names by `crate::` or `super::`, from the root of the crate; docs included.
fn uses(module: &[String], text: &str) -> Vec<Vec<String>> {
    let mut inside = module.to_vec();
    let mut found = Vec::new();
    for line in text.lines() {
        // A module within the file, of which every line is indented.
        if let Some((_, name)) = line.strip_suffix(" {").and_then(|line| line.rsplit_once("mod ")) {
            inside.push(name.to_owned());
        } else if line == "}" {
            inside.truncate(module.len());
        }
        let words = line.split(|c: char| !(c.is_alphanumeric() || c == '_' || c == ':'));
        found.extend(words.filter_map(|word| absolute(&inside, word)));
    }
    found
}

/// The path from the root of the crate that a word like `super::game::Game` names.
fn absolute(module: &[String], word: &str) -> Option<Vec<String>> {
    let mut path = match word.split_once("::")?.0 {
        "crate" => Vec::new(),
        "super" => module.to_vec(),
        _ => return None,
    };
    for name in word.split("::") {
        match name {
            "crate" => {}
            "super" => {
                path.pop();
            }
            // What follows is a group or a star: `use super::*`.
            "" => break,
            _ => path.push(name.to_owned()),
        }
    }
    Some(path)
}

/// What a source text uses that does not stand above its module, and how many uses were checked.
fn violations(module: &[String], text: &str) -> (Vec<String>, usize) {
    let position = |name: &str| LAYERS.iter().position(|&layer| layer == name);
    let room = |path: &[String]| path.get(1).and_then(|own| SYNTHESIS.iter().position(|&(name, _)| name == own));
    let Some(own) = module.first() else { return (Vec::new(), 0) };
    let Some(layer) = position(own) else { return (vec![format!("{own} is no layer")], 0) };
    let mut wrong = Vec::new();
    let used = uses(module, text);
    for path in &used {
        let shown = path.join("::");
        let Some(name) = path.first() else {
            wrong.push(format!("{} names the crate itself, or several of its layers at once", module.join("::")));
            continue;
        };
        if position(name).is_none_or(|used| used > layer) {
            wrong.push(format!("{} uses {shown}, which does not stand above it", module.join("::")));
        }
        let (true, Some(own)) = (own == "synthesis", room(module)) else { continue };
        let allowed = if name == "synthesis" {
            room(path).is_some_and(|used| used <= own)
        } else {
            SYNTHESIS[own].1.contains(&name.as_str())
        };
        if !allowed {
            wrong.push(format!("{} uses {shown}, which it is not to know", module.join("::")));
        }
    }
    (wrong, used.len())
}

#[test]
fn a_layer_uses_only_layers_above_it() {
    let mut checked = 0;
    for (file, relative) in core() {
        let module = module(&relative);
        let (wrong, count) = violations(&module, &fs::read_to_string(&file).expect("a readable source"));
        assert!(wrong.is_empty(), "{}: {wrong:#?}", file.display());
        checked += count;
    }
    assert!(checked > 200, "only {checked} uses found: is the test still looking at the sources?");
}

/// The check itself: what it must find, and what it must not.
#[test]
fn a_use_of_what_stands_below_is_found() {
    let found = |file: &str, text: &str| violations(&module(Path::new(file)), text).0.len();
    for (file, text) in [
        ("game/grid.rs", "use crate::policy::Policy;"),
        ("game/grid.rs", "use super::super::policy::Policy;"),
        ("game/mod.rs", "fn f() { super::riccati::solve() }"),
        ("simd/width.rs", "use crate::{game::Game, error::SimdError};"),
        ("cancel.rs", "mod tests {\n    use super::super::game::Game;\n}"),
        ("unknown/mod.rs", ""),
        ("synthesis/newton/tile.rs", "use crate::network::Topology;"),
        ("synthesis/newton/tile.rs", "use crate::game::Game;"),
        ("synthesis/newton/tile.rs", "use crate::synthesis::theta::Problem;"),
        ("synthesis/newton/mod.rs", "use super::search::Search;"),
        ("synthesis/newton/mod.rs", "use super::{search, theta};"),
        ("synthesis/newton/tile.rs", "use crate::synthesis::Gains;"),
        ("synthesis/theta/real.rs", "use crate::network::Topology;"),
        ("synthesis/theta/real.rs", "/// See [`crate::synthesis::search`]."),
        ("synthesis/search/start.rs", "use crate::riccati::Equilibrium;"),
        ("synthesis/search/start.rs", "use crate::policy::Policy;"),
    ] {
        assert_eq!(found(file, text).min(1), 1, "{file}: {text}");
    }
    for (file, text) in [
        ("policy/mod.rs", "use crate::synthesis::Gains; use super::game::Game;"),
        ("cancel.rs", "mod tests {\n    use super::*;\n}"),
        ("game/grid.rs", "use super::validation::rule; use crate::error::GameError;"),
        ("synthesis/mod.rs", "use crate::network::Topology; use super::riccati;"),
        ("synthesis/newton/tile.rs", "use super::layout::{GROUP, packed}; use crate::simd::Number; use super::*;"),
        ("synthesis/theta/real.rs", "use crate::synthesis::newton::{Form, Slot}; use crate::game::Game;"),
        ("synthesis/search/stages.rs", "use super::start::variables; use crate::synthesis::theta::Problem;"),
    ] {
        assert_eq!(found(file, text), 0, "{file}: {text}");
    }
}

#[test]
fn the_core_knows_nothing_of_python() {
    for manifest in ["Cargo.toml", "../tadcore-kernels/Cargo.toml"] {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(manifest);
        let manifest = fs::read_to_string(path).expect("a manifest");
        assert!(!manifest.contains("pyo3") && !manifest.contains("numpy"));
    }
}

/// The lines of a source text, comments included, in which `unsafe` is a word of its own.
fn unsafe_lines(text: &str) -> Vec<usize> {
    let is_word = |line: &str| line.split(|c: char| !(c.is_alphanumeric() || c == '_')).any(|word| word == "unsafe");
    text.lines().enumerate().filter(|(_, line)| is_word(line)).map(|(number, _)| number + 1).collect()
}

#[test]
fn unsafe_code_stands_in_simd_alone() {
    let mut inside = 0;
    for (file, relative) in core() {
        let found = unsafe_lines(&fs::read_to_string(&file).expect("a readable source"));
        if relative.starts_with("simd") {
            inside += found.len();
        } else {
            assert!(found.is_empty(), "{}: unsafe in lines {found:?}", file.display());
        }
    }
    assert!(inside > 10, "only {inside} lines found: is the test still looking at the sources?");
}

/// The test above sees what it should.
#[test]
fn planted_unsafe_code_is_found() {
    for text in
        ["let x = unsafe { y() };", "unsafe fn f() {}", "unsafe{f()}", "    // SAFETY: unsafe on purpose", "(unsafe)"]
    {
        assert_eq!(unsafe_lines(&format!("fn a() {{}}\n{text}\n")), [2], "{text}");
    }
    assert_eq!(unsafe_lines("fn unsafely() {}\n#![deny(unsafe_op_in_unsafe_fn)]\nlet not_unsafe = 1;"), [0; 0]);
}

/// Threads share data by safe Rust alone, so that the compiler has proved the absence of races: raw pointers cannot be
/// shared unless a type says of itself that it can, and nothing here does. What is unsafe are vector instructions.
#[test]
fn nothing_unsafe_is_shared_between_threads() {
    for (file, _) in core() {
        let text = fs::read_to_string(&file).expect("a readable source");
        let code: Vec<&str> = text.lines().filter(|line| !line.trim_start().starts_with("//")).collect();
        for word in ["unsafe impl", "static mut", "UnsafeCell", "transmute"] {
            assert!(!code.iter().any(|line| line.contains(word)), "{}: {word}", file.display());
        }
    }
}
