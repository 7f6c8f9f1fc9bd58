//! Where the likelihood's search begins: ellipses of a grid of gains and phases.

use super::curve::Curve;

/// Readings that are looked at.
pub(super) const LOOKED_AT: usize = 512;

/// Sizes of `z_(-1) / z_1` tried: the last is an ellipse of axes 3 to 1.
const SIZES: [f64; 6] = [0.03, 0.08, 0.15, 0.25, 0.37, 0.5];

/// Directions tried of each.
const DIRECTIONS: usize = 12;

/// Ellipses of the least squares, best first, each with its sum.
///
/// `z - w conj(z)` sends the ellipse of `z_(-1) = w z_1` to a circle, whose middle and radius are a
/// linear problem (Kasa).
pub(super) fn starts(cosine: &[f64], sine: &[f64]) -> Vec<Curve> {
    let round = std::iter::once((0.0, 0.0));
    let others = SIZES.iter().flat_map(|&size| {
        (0..DIRECTIONS).map(move |i| {
            let turn = std::f64::consts::TAU * i as f64 / DIRECTIONS as f64;
            (size * turn.cos(), size * turn.sin())
        })
    });
    let mut found: Vec<(f64, Curve)> = round
        .chain(others)
        .filter_map(|(re, im)| {
            let (curve, squares) = ellipse(cosine, sine, re, im)?;
            Some((squares, curve))
        })
        .collect();
    found.sort_by(|a, b| a.0.total_cmp(&b.0));
    found.into_iter().map(|(_, curve)| curve).collect()
}

/// The ellipse of one `w`, and the squares of the distances to it, to first order.
fn ellipse(cosine: &[f64], sine: &[f64], re: f64, im: f64) -> Option<(Curve, f64)> {
    let rounded: Vec<(f64, f64)> = cosine
        .iter()
        .zip(sine)
        .map(|(&x, &y)| (x - (re * x + im * y), y - (im * x - re * y)))
        .collect();
    let (middle, radius) = circle(&rounded)?;
    let mut squares = 0.0;
    for &(x, y) in &rounded {
        let (x, y) = (x - middle.0, y - middle.1);
        let size = x.hypot(y);
        // |1 - conj(w) exp(2 i psi)|: how much a step across the ellipse is stretched.
        let (twice_cosine, twice_sine) =
            ((x * x - y * y) / (size * size), 2.0 * x * y / (size * size));
        let stretched =
            (1.0 - re * twice_cosine - im * twice_sine).hypot(im * twice_cosine - re * twice_sine);
        squares += ((size - radius) / stretched).powi(2);
    }
    // Back: z = (z' + w conj(z')) / (1 - |w|^2).
    let shrunk = 1.0 - re * re - im * im;
    let (x, y) = middle;
    let offset = (
        (x + re * x + im * y) / shrunk,
        (y + im * x - re * y) / shrunk,
    );
    let radius = radius / shrunk;
    // The phase is counted from where the cosine is at its top.
    let (sine, cosine) = im.atan2(1.0 + re).sin_cos();
    let parameters = vec![
        offset.0,
        offset.1,
        radius * (1.0 + re).hypot(im),
        radius * ((1.0 - re) * cosine - im * sine),
        radius * ((1.0 - re) * sine + im * cosine),
    ];
    let curve = Curve {
        orders: Vec::new(),
        parameters,
    };
    (squares.is_finite() && radius > 0.0).then_some((curve, squares))
}

/// Middle and radius of the circle `x^2 + y^2 = 2 a x + 2 b y + c` of the least squares, of
/// points whose mean is near zero.
fn circle(points: &[(f64, f64)]) -> Option<((f64, f64), f64)> {
    let n = points.len() as f64;
    let mean = |f: &dyn Fn(f64, f64) -> f64| points.iter().map(|&(x, y)| f(x, y)).sum::<f64>() / n;
    let (mx, my) = (mean(&|x, _| x), mean(&|_, y| y));
    let square = mean(&|x, y| x * x + y * y);
    let (xx, yy) = (
        mean(&|x, _| (x - mx).powi(2)),
        mean(&|_, y| (y - my).powi(2)),
    );
    let xy = mean(&|x, y| (x - mx) * (y - my));
    let along =
        |f: &dyn Fn(f64, f64) -> f64| 0.5 * mean(&|x, y| (x * x + y * y - square) * f(x, y));
    let (px, py) = (along(&|x, _| x - mx), along(&|_, y| y - my));
    let determinant = xx * yy - xy * xy;
    if determinant.is_nan() || determinant <= 0.0 {
        return None;
    }
    let a = (px * yy - py * xy) / determinant;
    let b = (py * xx - px * xy) / determinant;
    let radius = (square - 2.0 * (a * mx + b * my) + a * a + b * b).sqrt();
    radius.is_finite().then_some(((a, b), radius))
}
