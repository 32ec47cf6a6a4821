use plychain::sample::stream::{Key, blocks};

/// Known answers of the authors' library (Random123, `kat_vectors`).
#[test]
fn threefry_gives_the_known_answers() {
    let of = |counter: [u64; 2], key: [u64; 2]| {
        let [seed, ensemble] = key;
        let ([a], [b]) = blocks(Key { seed, ensemble }, [counter[0]], counter[1]);
        [a, b]
    };
    assert_eq!(
        of([0; 2], [0; 2]),
        [0xc2b6_e3a8_c2c6_9865, 0x6f81_ed42_f350_084d]
    );
    assert_eq!(
        of([u64::MAX; 2], [u64::MAX; 2]),
        [0xe02c_b7c4_d95d_277a, 0xd066_33d0_893b_8b68]
    );
    assert_eq!(
        of(
            [0x243f_6a88_85a3_08d3, 0x1319_8a2e_0370_7344],
            [0xa409_3822_299f_31d0, 0x082e_fa98_ec4e_6c89]
        ),
        [0x263c_7d30_bb0f_0af1, 0x56be_8361_d331_1526]
    );
}
