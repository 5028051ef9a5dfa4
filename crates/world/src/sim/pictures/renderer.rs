//! The renderer of this process's frames.

use trace::renderer::Renderer;

const SOFTWARE: [&str; 4] = ["llvmpipe", "softpipe", "swrast", "SwiftShader"];

/// The environment variable that limits the processor extensions used by Mesa.
const LIMIT: &str = "GALLIUM_OVERRIDE_CPU_CAPS";

/// The renderer of the context that is current on this thread.
pub fn current() -> Renderer {
    let Some(gl::Names { vendor, renderer, version }) = gl::names() else {
        return Renderer { name: "unknown".to_owned(), version: None, vendor: None, processor: Some(processor()) };
    };
    let is_software = SOFTWARE.iter().any(|name| renderer.contains(name));
    let processor = is_software.then(processor);
    Renderer { name: renderer, version: Some(version), vendor: Some(vendor), processor }
}

/// The extensions of the processor, or the limit from the environment.
fn processor() -> String {
    let limit = std::env::var(LIMIT).ok().filter(|limit| !limit.is_empty());
    let extensions = limit.map_or_else(extensions, |limit| format!("limited to {limit}"));
    format!("{} {extensions}", std::env::consts::ARCH)
}

#[cfg(target_arch = "x86_64")]
fn extensions() -> String {
    let found = [
        ("sse4.2", is_x86_feature_detected!("sse4.2")),
        ("avx", is_x86_feature_detected!("avx")),
        ("f16c", is_x86_feature_detected!("f16c")),
        ("fma", is_x86_feature_detected!("fma")),
        ("avx2", is_x86_feature_detected!("avx2")),
        ("avx512f", is_x86_feature_detected!("avx512f")),
    ];
    found.into_iter().filter(|(_, is_there)| *is_there).map(|(name, _)| name).collect::<Vec<_>>().join(" ")
}

#[cfg(not(target_arch = "x86_64"))]
fn extensions() -> String {
    "all".to_owned()
}
