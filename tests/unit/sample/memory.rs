use plychain::sample::Block;
use plychain::sample::memory::Memory;
use rayon::prelude::*;

const WALKERS: usize = 2;
const DIM: usize = 3;
const ENSEMBLES: usize = 2;

/// A number that tells where it belongs.
fn number(ensemble: usize, walker: usize, draw: usize, parameter: usize) -> f64 {
    (((ensemble * 10 + walker) * 10 + parameter) * 1000 + draw) as f64
}

fn block(ensemble: usize, draws: std::ops::Range<usize>) -> Block {
    let mut block = Block::default();
    for draw in draws {
        for parameter in 0..DIM {
            let x = (0..WALKERS).map(|w| number(ensemble, w, draw, parameter));
            block.x.extend(x);
        }
        let lp = (0..WALKERS).map(|w| number(ensemble, w, draw, DIM));
        block.lp.extend(lp);
    }
    block
}

/// Whatever the blocks and the looks between them, what is held is every draw that is a multiple of the stride,
/// and the stride is the smallest power of two that leaves no more of them than there may be.
#[test]
fn memory_holds_every_draw_of_its_stride() {
    for most in [1, 4, 7, 16, 1000] {
        let mut memory = Memory::new(ENSEMBLES, WALKERS, DIM);
        let mut seen = 0;
        for count in [1, 3, 18, 2, 40, 1, 33] {
            memory.reserve((seen + count).min(most));
            let counts: Vec<_> = memory
                .shares()
                .enumerate()
                .map(|(ensemble, mut share)| {
                    share.take(&block(ensemble, seen..seen + count));
                    share.count()
                })
                .collect();
            assert!(counts.iter().all(|c| *c == counts[0]));
            memory.taken(counts[0]);
            seen += count;
            let stride = (0..).map(|k| 1 << k).find(|s| seen / s <= most).unwrap();
            assert_eq!((memory.seen(), memory.stride()), (seen, stride));
            let names: Vec<String> = (0..DIM).map(|k| format!("p{k}")).collect();
            let draws = memory.lend(&names).unwrap();
            let held: Vec<usize> = (0..seen).filter(|d| (d + 1) % stride == 0).collect();
            assert_eq!(draws.draws(), held.len());
            for (chain, &ensemble) in draws.ensemble().iter().enumerate() {
                let walker = chain % WALKERS;
                assert_eq!(ensemble, chain / WALKERS);
                for (row, &draw) in held.iter().enumerate() {
                    let expected = [0, 1, 2].map(|p| number(ensemble, walker, draw, p));
                    assert_eq!(draws.point(chain, row), expected);
                    let lp = draws.lp()[chain * held.len() + row];
                    assert_eq!(lp, number(ensemble, walker, draw, DIM));
                }
            }
            memory.restore(draws);
        }
    }
}
