//! The Python package `pycolmap` in the place of the command line, which it does not have.
//!
//! In: the arguments of a step, as the command line takes them. Out: the script that does the step with the functions
//! of the package, version 4 or later; with `-h` it lists the options.

/// A script that succeeds where the package is installed, and writes its name and version.
pub(crate) const CHECK: &str =
    "import pycolmap as c; c.FeatureExtractionOptions; c.match_exhaustive; print('pycolmap', c.__version__)";

/// The script. Options are set where the command line has them: `Mapper.tri_x` is `x` of the triangulation.
pub(crate) const SCRIPT: &str = r#"
import sys
import pycolmap as c

def options(step):
    if step == 'feature_extractor':
        extraction = c.FeatureExtractionOptions()
        return {'ImageReader': [c.ImageReaderOptions()], 'FeatureExtraction': [extraction],
                'SiftExtraction': [extraction.sift]}
    if step == 'exhaustive_matcher':
        matching = c.FeatureMatchingOptions()
        return {'FeatureMatching': [matching], 'SiftMatching': [matching.sift]}
    mapping = c.IncrementalPipelineOptions()
    return {'Mapper': [mapping, mapping.mapper, mapping.triangulation]}

def change(targets, name, text):
    for target in targets:
        for own in (name, name.removeprefix('tri_')):
            if hasattr(target, own):
                old = getattr(target, own)
                setattr(target, own, text == '1' if isinstance(old, bool) else type(old)(text))
                return

step, words = sys.argv[1], sys.argv[2:]
groups = options(step)
if words == ['-h']:
    for group, targets in groups.items():
        for target in targets:
            for name in dir(target):
                print(f'--{group}.{name}')
    print('--ImageReader.single_camera_per_folder')
    for name in dir(c.IncrementalPipelineOptions().triangulation):
        print(f'--Mapper.tri_{name}')
    sys.exit()
paths = {}
for word, text in zip(words[::2], words[1::2]):
    group, dot, name = word.removeprefix('--').partition('.')
    if dot:
        change(groups[group], name, text)
    else:
        paths[group] = text
if step == 'feature_extractor':
    c.extract_features(paths['database_path'], paths['image_path'], camera_mode=c.CameraMode.PER_FOLDER,
                       reader_options=groups['ImageReader'][0], extraction_options=groups['FeatureExtraction'][0],
                       device=c.Device.cpu)
elif step == 'exhaustive_matcher':
    c.match_exhaustive(paths['database_path'], matching_options=groups['FeatureMatching'][0], device=c.Device.cpu)
elif step == 'mapper':
    if not c.incremental_mapping(paths['database_path'], paths['image_path'], paths['output_path'],
                                 options=groups['Mapper'][0]):
        sys.exit('no model was found')
elif step == 'point_triangulator':
    c.triangulate_points(c.Reconstruction(paths['input_path']), paths['database_path'], paths['image_path'],
                         paths['output_path'], options=groups['Mapper'][0])
else:
    sys.exit('unknown step ' + step)
"#;
