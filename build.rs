//! Finds Embree >= 4, compiles the C part of `src/embree/` against its headers, and makes the bindings to that part.
//!
//! Looks in the C compiler's own places and under `/usr/local`; `EMBREE_DIR` names another installation (the directory
//! that holds `include/embree4/`), which then comes first. What is missing ends the build with one sentence.
//! With `DOCS_RS` set, only the bindings are made: docs need no Embree.

use std::env;
use std::fs;
use std::panic;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

const PROBE: &str = "
#include <embree4/rtcore.h>
#if RTC_VERSION_MAJOR < 4
#error too old
#endif
int main(void) { return rtcNewDevice(0) == 0; }
";

fn main() {
    for input in [
        "build.rs",
        "src/embree/rays.c",
        "src/embree/rays.h",
        "src/embree/packet.h",
    ] {
        println!("cargo:rerun-if-changed={input}");
    }
    println!("cargo:rerun-if-env-changed=EMBREE_DIR");
    println!("cargo:rerun-if-env-changed=DOCS_RS");

    let out = PathBuf::from(env::var_os("OUT_DIR").unwrap_or_default());
    if env::var_os("DOCS_RS").is_none() {
        compile_and_link(&out);
    }
    bind(&out);
}

/// Compiles the C part against Embree's headers and links both.
fn compile_and_link(out: &Path) {
    let embree = Embree::find();
    if !embree.links(out) {
        give_up("Embree 4 or later with its headers");
    }
    println!("cargo:rerun-if-changed={}", embree.config_header().display());

    let mut c = embree.compiler();
    if c.file("src/embree/rays.c").try_compile("radiosity_rays").is_err() {
        give_up("a C compiler that can compile src/embree/rays.c");
    }
    compile_bare_loop(&embree);

    // After the C object that needs it. Rust's own linker does not search /usr/local by itself.
    for directory in &embree.libraries {
        println!("cargo:rustc-link-search=native={}", directory.display());
        if embree.chosen {
            println!("cargo:rustc-link-arg=-Wl,-rpath,{}", directory.display());
        }
    }
    println!("cargo:rustc-link-lib=embree4");
}

/// Ends the build with one sentence.
fn give_up(missing: &str) -> ! {
    eprintln!("radiosity needs {missing}: run ./setup.sh, which installs it.");
    std::process::exit(1);
}

/// An installation of Embree.
struct Embree {
    includes: Vec<PathBuf>,
    libraries: Vec<PathBuf>,
    /// True if `EMBREE_DIR` chose it: then the programs must find the library there, too.
    chosen: bool,
}

impl Embree {
    fn find() -> Self {
        let chosen = env::var_os("EMBREE_DIR").filter(|dir| !dir.is_empty());
        let prefix = PathBuf::from(chosen.clone().unwrap_or_else(|| "/usr/local".into()));
        let triplet = format!(
            "lib/{}-linux-gnu",
            env::var("CARGO_CFG_TARGET_ARCH").unwrap_or_default()
        );
        let existing = |names: &[&str]| -> Vec<PathBuf> {
            names
                .iter()
                .map(|name| prefix.join(name))
                .filter(|dir| dir.is_dir())
                .collect()
        };
        Self {
            includes: existing(&["include"]),
            libraries: existing(&["lib", "lib64", &triplet]),
            chosen: chosen.is_some(),
        }
    }

    fn compiler(&self) -> cc::Build {
        let mut c = cc::Build::new();
        c.std("c11").includes(&self.includes);
        c
    }

    /// Returns true if a program that uses Embree >= 4 can be compiled and linked.
    fn links(&self, out: &Path) -> bool {
        let source = out.join("probe.c");
        let Ok(compiler) = self.compiler().cargo_metadata(false).try_get_compiler() else {
            return false;
        };
        let mut command: Command = compiler.to_command();
        command.arg(&source).arg("-o").arg(out.join("probe"));
        for directory in &self.libraries {
            command.arg("-L").arg(directory);
        }
        command.arg("-lembree4").stdout(Stdio::null()).stderr(Stdio::null());
        fs::write(&source, PROBE).is_ok() && command.status().is_ok_and(|status| status.success())
    }

    /// The header that changes with Embree's version.
    fn config_header(&self) -> PathBuf {
        let name = "embree4/rtcore_config.h";
        let mut places = self.includes.iter().map(|dir| dir.join(name));
        places
            .find(|path| path.exists())
            .unwrap_or_else(|| Path::new("/usr/include").join(name))
    }
}

/// Compiles the loop that the benchmark of the rays compares with, and links it to benchmarks only.
fn compile_bare_loop(embree: &Embree) {
    let source = "benches/rays/bare.c";
    if !Path::new(source).exists() {
        return; // a packaged crate has no benchmarks
    }
    println!("cargo:rerun-if-changed={source}");
    let mut c = embree.compiler();
    match c.cargo_metadata(false).file(source).try_compile_intermediates() {
        Ok(objects) => {
            for object in objects {
                println!("cargo:rustc-link-arg-benches={}", object.display());
            }
            // Once more behind the object: to a linker that drops libraries that nothing before them needs.
            println!("cargo:rustc-link-arg-benches=-lembree4");
        }
        Err(_) => give_up("a C compiler that can compile benches/rays/bare.c"),
    }
}

/// Writes the bindings to `rays.h`.
fn bind(out: &Path) {
    // bindgen panics where it finds no libclang; one sentence says it better.
    panic::set_hook(Box::new(|_| {}));
    let bindings = panic::catch_unwind(|| {
        bindgen::Builder::default()
            .header("src/embree/rays.h")
            .allowlist_item("(radiosity|RADIOSITY)_.*")
            .formatter(bindgen::Formatter::None)
            .generate()
    });
    let written = match bindings {
        Ok(Ok(bindings)) => bindings.write_to_file(out.join("rays.rs")).is_ok(),
        _ => give_up("libclang, for the bindings to its C part"),
    };
    if !written {
        eprintln!("radiosity's build script cannot write to {}.", out.display());
        std::process::exit(1);
    }
}
