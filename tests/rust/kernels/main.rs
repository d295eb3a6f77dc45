//! The kernels' own tests, by room. They stand outside, so that the kernels, which take long to compile, are compiled once.

mod memory;
mod policy {
    mod step_table;
}
mod simd {
    mod lanes;
    mod width;
}
mod synthesis {
    mod factor;
    mod layout;
}
