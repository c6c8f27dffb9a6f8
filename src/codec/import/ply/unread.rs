//! The elements and properties of a PLY file that are not read.
//!
//! In: the layout and the elements of a header. Out: sentences with their names.

use super::deltas;
use super::header::Element;
use super::layout::Layout;
use super::splats::PLAIN;
use crate::codec::text::printable;

/// Most names in a sentence.
const NAMES: usize = 8;

/// Returns a sentence about the elements, and one about the properties of the vertices, that are not read.
pub(super) fn sentences(layout: Layout, elements: &[Element]) -> Vec<String> {
    let others = elements.iter().filter(|element| element.name != "vertex" && !is_read(layout, &element.name));
    let others: Vec<String> =
        others.map(|element| format!("{} ({} rows)", printable(&element.name), element.count)).collect();
    let vertex = elements.iter().find(|element| element.name == "vertex");
    let names = || vertex.into_iter().flat_map(|vertex| &vertex.properties).map(|property| property.name.as_str());
    let has_coefficients = names().any(|name| name == "f_dc_0");
    let is_unread = |name: &&str| !is_property(layout, name, has_coefficients);
    let properties: Vec<String> = names().filter(is_unread).map(printable).collect();
    let lists = [("Elements of the file", others), ("Properties of its vertices", properties)];
    lists.into_iter().filter_map(|(what, names)| sentence(what, names)).collect()
}

/// Returns whether an element beside the vertices is read.
fn is_read(layout: Layout, name: &str) -> bool {
    match layout {
        Layout::Compressed => ["chunk", "sh"].contains(&name),
        Layout::Splats => deltas::is_element(name),
        _ => false,
    }
}

/// Returns whether a property of the vertices is read, or is a normal, which Gaussians do not have and trainers write.
fn is_property(layout: Layout, name: &str, has_coefficients: bool) -> bool {
    let numbered = |stems: &[&str]| stems.iter().any(|stem| is_numbered(name, stem));
    let of_layout = match layout {
        Layout::Splats => false,
        Layout::Compressed => return name.starts_with("packed_"),
        Layout::FreeTime => ["time", "log_duration"].contains(&name) || numbered(&["velocity"]),
        Layout::Sogst => ["t_center", "t_sigma", "vx", "vy", "vz"].contains(&name),
        Layout::SogstCurved => ["t_center", "t_sigma", "vx", "vy", "vz", "ax", "ay", "az"].contains(&name),
        Layout::Sog4d => ["trbf_center", "trbf_scale"].contains(&name) || numbered(&["motion"]),
        Layout::Spacetime => ["trbf_center", "trbf_scale"].contains(&name) || numbered(&["motion", "omega"]),
        Layout::Rotated => return is_of_rotated(name),
    };
    let is_plain = PLAIN.contains(&name);
    of_layout
        || ["x", "y", "z", "nx", "ny", "nz", "opacity", "filter_3D"].contains(&name)
        || numbered(&["scale", "rot"])
        || if has_coefficients { numbered(&["f_dc", "f_rest"]) } else { is_plain }
}

/// Returns whether a property belongs to native 4D Gaussians.
fn is_of_rotated(name: &str) -> bool {
    let axis = name.strip_prefix("rot_").map(|rest| rest.strip_prefix("r_").unwrap_or(rest));
    ["x", "y", "z", "t", "sx", "sy", "sz", "st", "opacity"].contains(&name)
        || axis.is_some_and(|axis| ["x", "y", "z", "w"].contains(&axis))
        || ["feat_r", "feat_g", "feat_b"].iter().any(|stem| is_numbered(name, stem))
}

/// Returns whether a name is a stem with a number: `rot_0`.
fn is_numbered(name: &str, stem: &str) -> bool {
    let number = name.strip_prefix(stem).and_then(|rest| rest.strip_prefix('_'));
    number.is_some_and(|number| number.parse::<usize>().is_ok())
}

/// Returns the sentence about things that are not read; `None` if there are none.
fn sentence(what: &str, names: Vec<String>) -> Option<String> {
    let count = names.len();
    let shown = names.get(..NAMES).unwrap_or(&names).join(", ");
    let more = if count > NAMES { format!(" and {} more", count - NAMES) } else { String::new() };
    (count > 0).then(|| format!("{what} that are not read ({count}): {shown}{more}."))
}
