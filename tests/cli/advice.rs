//! The remedies of errors that name a command.
//!
//! In: a package, and options that contradict it. Out: proof that the command of the error makes a package that the options fit.

use crate::support::command::{arguments, folder, gs4d};
use crate::support::pth::Pth;
use std::ffi::OsString;
use std::fs;

#[test]
fn a_package_made_with_another_value_is_made_again_by_the_command_of_the_error() {
    let folder = folder();
    let [checkpoint, package, again] = ["chkpnt.pth", "a.gs4d", "again.gs4d"].map(|name| folder.path().join(name));
    fs::write(&checkpoint, Pth::rotating(20, 48).bytes()).expect("the folder can be written to");
    gs4d(&arguments!["convert", &checkpoint, &package]).text();
    for (option, value) in [
        ("--time-interval", Some("0,2")),
        ("--rotation-convention", Some("unflipped")),
        ("--force-sh-3d", None),
        ("--prefilter-var", Some("0.5")),
    ] {
        let given: Vec<OsString> = [Some(option), value].into_iter().flatten().map(OsString::from).collect();
        let with = |words: &[OsString]| gs4d(&[words, &given].concat());
        with(&arguments!["info", &package]).must_fail(&format!("gs4d convert {option}"));
        with(&arguments!["convert", &checkpoint, &again]).text();
        with(&arguments!["info", &again]).text();
        fs::remove_file(&again).expect("it was made");
    }
}
