//! An image of one's own in QEMU: its size, its log as it runs, and its exit code.
//!
//! `cargo xtask firmware`, then
//! `cargo run --release -p dithersteer-qemu --example own_image --
//! target/thumbv7em-none-eabihf/firmware/bench`

use image::Image;
use qemu::Machine;
use std::path::Path;
use std::time::Duration;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let path = std::env::args().nth(1).ok_or("give the path of an ELF")?;
    let image = Image::open(Path::new(&path))?;
    println!(
        "{} bytes of flash, {} bytes of RAM",
        image.flash_bytes, image.ram_bytes
    );

    let settings = [
        "run.duration_s=1".to_owned(),
        "run.wheel_speed_rpm=1600".to_owned(),
    ];
    let folder = tempfile::tempdir()?;
    let time_out = Duration::from_secs(60);
    let print = |line: &str| println!("{line}");
    let finished = qemu::run(
        &image,
        Machine::Mps2An386,
        &settings,
        folder.path(),
        time_out,
        &print,
    )?;
    println!(
        "exit code {}: {}",
        finished.exit_code,
        qemu::meaning(finished.exit_code)
    );
    Ok(())
}
