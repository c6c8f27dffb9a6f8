//! Masks in a folder `masks/` beside the images.
//!
//! In: the folder of a dataset, the path of an image in it. Out: the mask with the image's name, if there is one.

use std::path::{Component, Path, PathBuf};

/// Name of the folder of masks.
const FOLDER: &str = "masks";
/// Folders of images, in place of which the folder of masks stands.
const IMAGES: [&str; 2] = ["images", "frames"];

/// Returns the mask of an image: `masks/NAME`, `masks/NAME.png`, or `masks/NAME` with the extension `png`. An image
/// outside the folder has none.
pub(crate) fn beside(folder: &Path, image: &Path) -> Option<PathBuf> {
    let image = image.strip_prefix(folder).unwrap_or(image);
    let parts: Vec<Component> = image.components().filter(|part| *part != Component::CurDir).collect();
    if !parts.iter().all(|part| matches!(part, Component::Normal(_))) {
        return None;
    }
    let mut parts = parts.into_iter().peekable();
    if parts.peek().is_some_and(|part| IMAGES.iter().any(|name| part.as_os_str() == *name)) {
        parts.next();
    }
    let mask = folder.join(FOLDER).join(parts.collect::<PathBuf>());
    let mut longer = mask.clone().into_os_string();
    longer.push(".png");
    [mask.with_extension("png"), mask, longer.into()].into_iter().find(|path| path.is_file())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    #[test]
    fn masks_have_the_names_of_images_inside_the_folder() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let at = |name: &str| folder.path().join(name);
        for name in ["masks/a.png", "masks/cam0/b.jpg.png", "masks/cam1/c.jpg", "images/d.png", "d.png"] {
            fs::create_dir_all(at(name).parent().expect("a folder")).expect("the folder can be made");
            fs::write(at(name), b"").expect("the folder can be written to");
        }
        let found = |image: &str| beside(folder.path(), Path::new(image));
        assert_eq!(found("./images/a.jpg"), Some(at("masks/a.png")), "the extension png in place of that of the image");
        assert_eq!(found("frames/cam0/b.jpg"), Some(at("masks/cam0/b.jpg.png")), "the extension png after the name");
        assert_eq!(found("cam1/c.jpg"), Some(at("masks/cam1/c.jpg")), "the name of the image");
        let whole = at("images/a.png");
        assert_eq!(beside(folder.path(), &whole), Some(at("masks/a.png")), "an image by its whole path");
        assert_eq!(found("images/d.png"), None, "an image without a mask");
        assert_eq!(found("../images/d.png"), None, "masks/../images/d.png would be the image itself");
        assert_eq!(found("/dev/null"), None, "an image outside the folder");
    }
}
