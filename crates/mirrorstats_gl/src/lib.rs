//! The strings by which a thread's OpenGL context identifies itself: vendor, renderer, version.
//!
//! Rule: only the function here that asks the driver is unsafe. It reads three strings and changes nothing.
//!
//! ```
//! // A thread has no current context before it makes one.
//! assert_eq!(mirrorstats_gl::names(), None);
//! ```

/// Identification strings of a context.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Names {
    /// `GL_VENDOR`, such as `Mesa`.
    pub vendor: String,
    /// `GL_RENDERER`, such as `llvmpipe (LLVM 15.0.6, 256 bits)`.
    pub renderer: String,
    /// `GL_VERSION`, such as `4.5 (Compatibility Profile) Mesa 22.3.6`.
    pub version: String,
}

/// The strings of the current context of this thread; `None` without a context, or if EGL did not create it.
pub fn names() -> Option<Names> {
    const VENDOR: u32 = 0x1F00;
    const RENDERER: u32 = 0x1F01;
    const VERSION: u32 = 0x1F02;
    let [vendor, renderer, version] = strings([VENDOR, RENDERER, VERSION])?;
    Some(Names { vendor, renderer, version })
}

#[cfg(target_os = "linux")]
#[expect(unsafe_code, reason = "a driver is asked in C")]
fn strings(names: [u32; 3]) -> Option<[String; 3]> {
    use std::ffi::{CStr, c_char, c_void};

    type Address = unsafe extern "C" fn(*const c_char) -> *const c_void;
    type GetString = unsafe extern "C" fn(u32) -> *const c_char;

    // SAFETY: libEGL has no initialisers with preconditions; a renderer of this process has loaded it already.
    let egl = unsafe { libloading::Library::new("libEGL.so.1") }.ok()?;
    // SAFETY: the signature matches the EGL specification.
    let address = unsafe { egl.get::<Address>(b"eglGetProcAddress\0") }.ok()?;
    // SAFETY: the name ends with a zero.
    let get_string = unsafe { address(c"glGetString".as_ptr()) };
    if get_string.is_null() {
        return None;
    }
    // SAFETY: this function has this signature in every version of OpenGL.
    let get_string = unsafe { std::mem::transmute::<*const c_void, GetString>(get_string) };
    let text = |name| {
        // SAFETY: without a current context the result is null, else a string that lives as long as the context.
        let text = unsafe { get_string(name) };
        // SAFETY: as above.
        (!text.is_null()).then(|| unsafe { CStr::from_ptr(text) }.to_string_lossy().into_owned())
    };
    let [vendor, renderer, version] = names.map(text);
    Some([vendor?, renderer?, version?])
}

#[cfg(not(target_os = "linux"))]
const fn strings(_: [u32; 3]) -> Option<[String; 3]> {
    None
}

#[cfg(test)]
mod tests {
    #[test]
    fn a_thread_without_a_context_has_no_names() {
        assert_eq!(super::names(), None);
    }
}
