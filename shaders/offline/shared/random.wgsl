// Random words by hashing; CPU reference: src/offline/train/reference/random_words.rs.
#define_import_path gs4d::random

// Returns a word of which each bit depends on every bit of the argument.
fn mixed(word: u32) -> u32 {
    var z = word;
    z = (z ^ (z >> 16u)) * 0x85ebca6bu;
    z = (z ^ (z >> 13u)) * 0xc2b2ae35u;
    return z ^ (z >> 16u);
}

// Returns the random word of a Gaussian at a step, which `seed` names.
fn word_of(index: u32, seed: u32) -> u32 {
    return mixed(seed ^ mixed(index + 0x9e3779b9u));
}
