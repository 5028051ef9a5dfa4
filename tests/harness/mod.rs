//! Shared by the tests of several folders: running the program, comparing folders, small traces, required programs.

#![expect(dead_code, reason = "every binary has all of it, and none uses all of it")]

#[cfg(target_os = "linux")]
pub mod bombs;
#[cfg(target_os = "linux")]
pub mod faults;
pub mod files;
pub mod logs;
pub mod need;
#[cfg(target_os = "linux")]
pub mod power;
pub mod program;
pub mod traces;

/// Asserts a snapshot that shows the input before the output.
// Exported, because otherwise every test binary would have to use it.
#[macro_export]
macro_rules! assert_shown {
    ($input:expr, $output:expr $(,)?) => {
        insta::with_settings!({ description => $input, omit_expression => true }, { insta::assert_snapshot!($output) })
    };
    ($name:literal, $input:expr, $output:expr $(,)?) => {
        insta::with_settings!({ description => $input, omit_expression => true }, {
            insta::assert_snapshot!($name, $output)
        })
    };
}
