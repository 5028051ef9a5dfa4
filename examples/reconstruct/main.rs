//! temp
mod reconstruction;
use reconstruction::{
    episodes,
    published::{self, Reading},
};
fn main() {
    for p in published::pairs(Reading::AsPrinted) {
        if let Err(e) = reconstruction::outline::solve(&p) {
            println!("{e}");
        }
    }
    let t0 = std::time::Instant::now();
    for p in published::pairs(Reading::Corrected) {
        let t = std::time::Instant::now();
        match episodes(&p) {
            Ok(e) => println!(
                "{} {} {} {:?} {:?}",
                p.experiment,
                p.model,
                e.iter().map(|e| e.steps.len()).sum::<usize>(),
                e.iter().map(|e| e.steps.len()).collect::<Vec<_>>(),
                t.elapsed()
            ),
            Err(e) => println!("{e} {:?}", t.elapsed()),
        }
    }
    println!("{:?}", t0.elapsed());
}
