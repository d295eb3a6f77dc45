//! The choice among widths.

use tadcore_kernels::error::SimdError;
use tadcore_kernels::simd::Width;

#[test]
fn the_variable_chooses_among_the_widths_of_the_processor() {
    let all = Width::all();
    assert_eq!(all[0], Width::Baseline);
    for unset in [None, Some(String::new())] {
        assert_eq!(Width::choose(unset), Ok(all[all.len() - 1]));
    }
    let available: Vec<_> = all.iter().map(|width| width.name()).collect();
    for name in Width::NAMES {
        let found = Width::choose(Some(name.to_owned()));
        match all.iter().find(|width| width.name() == name) {
            Some(&width) => assert_eq!(found, Ok(width)),
            None => {
                let (value, available) = (name.to_owned(), available.clone());
                assert_eq!(found, Err(SimdError::Absent { value, available }));
            }
        }
    }
    for name in ["AVX2", "avx", "sse2", "avx2 ", "0"] {
        let error = Width::choose(Some(name.to_owned())).expect_err("no width");
        let allowed = "it must be baseline, avx2 or avx512 (or empty: the widest); this processor has baseline";
        assert!(error.to_string().starts_with(&format!("TADCORE_SIMD is {name:?}, but {allowed}")), "{error}");
    }
}

#[test]
fn a_width_that_the_processor_lacks_is_named_with_those_it_has() {
    let error = SimdError::Absent { value: "avx512".to_owned(), available: vec!["baseline", "avx2"] };
    let said = "TADCORE_SIMD is \"avx512\", but this processor has only baseline, avx2";
    assert_eq!(error.to_string(), said);
}
