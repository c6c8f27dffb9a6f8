//! `gs4d compare`, run as a user runs it.
//!
//! In: pictures of known values. Out: proof that the numbers are right and that pictures that cannot be compared are
//! named.

use crate::support::command::{arguments, folder, gs4d};
use bevy_gs4d::view::Picture;
use glam::{UVec2, Vec3};
use std::fs;
use tempfile::TempDir;

#[test]
fn metrics_of_equal_and_different_pictures_are_right() {
    let (a, b) = (folder(), folder());
    let size = UVec2::new(24, 16);
    let save = |folder: &TempDir, name: &str, value: f32| {
        let picture = Picture::filled(size, Vec3::splat(value));
        picture.to_rgb8().save(folder.path().join(name)).expect("the folder can be written to");
    };
    save(&a, "same.png", 0.2);
    save(&b, "same.png", 0.2);
    save(&a, "other.png", 0.2);
    save(&b, "other.png", 0.4);
    save(&a, "alone.png", 0.1);
    let json = gs4d(&arguments!["compare", a.path(), b.path(), "--json"]).json();
    let row = |name: &str| {
        let pictures = json["pictures"].as_array().expect("a list of pictures");
        pictures.iter().find(|row| row["name"] == name).expect("the picture is listed").clone()
    };
    assert_eq!(
        (&row("same")["psnr"], &row("same")["identical"]),
        (&200.0.into(), &true.into()),
        "the largest PSNR, and a flag"
    );
    assert_eq!(row("other")["identical"], false, "different pictures are not marked as identical");
    assert!((row("same")["ssim"].as_f64().expect("a number") - 1.0).abs() < 1e-9, "identical");
    // 51 and 102 of 255: a difference of exactly one fifth.
    let psnr = row("other")["psnr"].as_f64().expect("a number");
    assert!((psnr - 13.979_4).abs() < 1e-3, "20 log10(5), not {psnr}");
    assert_eq!(json["only_in_a"][0], "alone", "a picture without a partner is listed");
    let mean = &json["mean"];
    assert_eq!(
        (&mean["identical"], &mean["psnr"]),
        (&1.into(), &psnr.into()),
        "identical pictures are left out of the mean"
    );
    let pooled = mean["psnr_pooled"].as_f64().expect("a number");
    assert!((pooled - psnr - 10.0 * 2f64.log10()).abs() < 1e-3, "the mean squared error is halved: {pooled}");
    let text = gs4d(&arguments!["compare", a.path(), b.path()]).text();
    assert!(
        text.contains("1 of 2 pictures are identical and not part of the mean PSNR"),
        "the text counts identical pictures: {text}"
    );

    let one = a.path().join("same.png");
    let text = gs4d(&arguments!["compare", &one, &b.path().join("other.png")]).text();
    assert!(text.contains("13.979"), "two files: {text}");
    save(&a, "same.jpg", 0.2);
    gs4d(&arguments!["compare", a.path(), b.path()]).must_fail("same.");
    gs4d(&arguments!["compare", b.path(), folder().path()]).must_fail("no two pictures");
    gs4d(&arguments!["compare", &one, b.path()]).must_fail("not a folder");
}

#[test]
fn truncated_pictures_are_named() {
    let folder = folder();
    let (png, jpg) = (folder.path().join("a.png"), folder.path().join("b.jpg"));
    let picture = Picture::filled(UVec2::new(64, 48), Vec3::new(0.2, 0.5, 0.8)).to_rgb8();
    picture.save(&png).expect("the folder can be written to");
    picture.save(&jpg).expect("the folder can be written to");
    gs4d(&arguments!["compare", &png, &jpg]).text();
    let bytes = fs::read(&jpg).expect("the picture");
    fs::write(&jpg, &bytes[..bytes.len() - 10]).expect("the folder can be written to");
    gs4d(&arguments!["compare", &png, &jpg]).must_fail("b.jpg");
    fs::write(&jpg, [&bytes[..bytes.len() - 10], &[0xff, 0xd9]].concat()).expect("the folder can be written to");
    gs4d(&arguments!["compare", &jpg, &png]).must_fail("b.jpg");
}

#[test]
fn raw_pictures_need_a_size() {
    let folder = folder();
    let path = folder.path().join("a.f32");
    let picture = Picture::filled(UVec2::new(16, 12), Vec3::new(-0.5, 0.5, 1.5));
    fs::write(&path, picture.to_raw()).expect("the folder can be written to");
    gs4d(&arguments!["compare", &path, &path]).must_fail("--size");
    gs4d(&arguments!["compare", &path, &path, "--size", "16x13"]).must_fail("a.f32");
    let json = gs4d(&arguments!["compare", &path, &path, "--size", "16x12", "--json"]).json();
    assert_eq!(json["pictures"][0]["psnr_pooled"], 200.0, "identical pictures have the largest PSNR");
    let png = folder.path().join("a.png");
    picture.clamped().to_rgb8().save(&png).expect("the folder can be written to");
    let json = gs4d(&arguments!["compare", &path, &png, "--size", "16x12", "--json"]).json();
    let psnr = json["pictures"][0]["psnr_pooled"].as_f64().expect("0.5 is no 8-bit value");
    // Of the three values only 0.5 is rounded, by half a step of 8 bits.
    let expected = -10.0 * ((0.5 / 255.0f64).powi(2) / 3.0).log10();
    assert!((psnr - expected).abs() < 1e-3, "clamped against 8 bits: {psnr}, not {expected}");
}
