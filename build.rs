//! Tells binaries and tests where MuJoCo's library is, so that they start without `LD_LIBRARY_PATH`. With the simulation only.

fn main() {
    println!("cargo::rerun-if-env-changed=MUJOCO_DYNAMIC_LINK_DIR");
    let simulates = ["mirrorstats_sim", "mirrorstats_record"].map(str::to_owned);
    if std::env::var_os("CARGO_FEATURE_SIM").is_none()
        && !simulates.contains(&std::env::var("CARGO_PKG_NAME").unwrap_or_default())
    {
        return;
    }
    if let Ok(directory) = std::env::var("MUJOCO_DYNAMIC_LINK_DIR") {
        println!("cargo::rustc-link-arg=-Wl,-rpath,{directory}");
    }
    // A distribution with bin/mirrorstats and lib/libmujoco.so beside it.
    println!("cargo::rustc-link-arg=-Wl,-rpath,$ORIGIN/../lib");
}
