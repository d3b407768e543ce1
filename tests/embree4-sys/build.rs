//! Makes the bindings from the installed headers.

use std::env;
use std::path::PathBuf;

use bindgen::callbacks::{EnumVariantValue, ParseCallbacks};

/// Gives enum variants the names that embree4-rs uses: without the prefix of their enum.
#[derive(Debug)]
struct ShortNames;

const PREFIXES: [(&str, &str); 6] = [
    ("enum RTCError", "RTC_ERROR_"),
    ("enum RTCBufferType", "RTC_BUFFER_TYPE_"),
    ("enum RTCBuildQuality", "RTC_BUILD_QUALITY_"),
    ("enum RTCFormat", "RTC_FORMAT_"),
    ("enum RTCGeometryType", "RTC_GEOMETRY_TYPE_"),
    ("enum RTCSceneFlags", "RTC_SCENE_FLAG_"),
];

impl ParseCallbacks for ShortNames {
    fn enum_variant_name(&self, name: Option<&str>, variant: &str, _: EnumVariantValue) -> Option<String> {
        let (_, prefix) = PREFIXES.iter().find(|(of, _)| Some(*of) == name)?;
        variant.strip_prefix(prefix).map(String::from)
    }
}

fn main() {
    println!("cargo:rerun-if-changed=build.rs");
    println!("cargo:rerun-if-changed=embree.h");
    println!("cargo:rerun-if-env-changed=EMBREE_DIR");
    let prefix = env::var("EMBREE_DIR").unwrap_or_else(|_| "/usr/local".into());
    let out = PathBuf::from(env::var_os("OUT_DIR").expect("cargo sets OUT_DIR"));
    bindgen::Builder::default()
        .header("embree.h")
        .clang_arg(format!("-I{prefix}/include"))
        .parse_callbacks(Box::new(ShortNames))
        .default_enum_style(bindgen::EnumVariation::NewType {
            is_bitfield: false,
            is_global: false,
        })
        .bitfield_enum("RTCSceneFlags|RTCRayQueryFlags")
        .constified_enum("_bindgen_ty.*")
        .allowlist_function("rtc(New|Release)(Device|Scene|Geometry)")
        .allowlist_function("rtc(GetDeviceError|SetNewGeometryBuffer|Commit(Scene|Geometry)|AttachGeometry)")
        .allowlist_function("rtc(SetSceneFlags|SetSceneBuildQuality|GetSceneBounds|Intersect1)")
        .allowlist_function("rtcSetGeometry(UserPrimitiveCount|UserData|BoundsFunction|IntersectFunction)")
        .allowlist_type("RTC(RayQueryContext|BoundsFunctionArguments|IntersectFunctionNArguments)")
        .allowlist_var("HEADER_.*")
        .blocklist_type("RTCHit|RTCRayHit")
        .generate()
        .expect("Embree's headers are installed: run ./setup.sh")
        .write_to_file(out.join("embree.rs"))
        .expect("OUT_DIR can be written");
}
