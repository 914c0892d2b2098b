//! Fewer points that draw the same picture. Points that are not finite are left out.

/// A point of a figure, in the units of its axes.
pub type Point = (f64, f64);

/// The least and the greatest point of each of `buckets` equal runs of points, in their order.
pub fn extremes(points: impl IntoIterator<Item = Point>, buckets: usize) -> Vec<Point> {
    let points = finite(points);
    if points.len() <= 2 * buckets {
        return points;
    }
    chunks(&points, buckets)
        .flat_map(|chunk| {
            let (low, high) = (least(chunk), greatest(chunk));
            let (first, second) = (low.min(high), low.max(high));
            std::iter::once(chunk[first]).chain((second != first).then(|| chunk[second]))
        })
        .collect()
}

/// The greatest point of each of `buckets` equal runs of points.
pub fn maxima(points: impl IntoIterator<Item = Point>, buckets: usize) -> Vec<Point> {
    let points = finite(points);
    if points.len() <= buckets {
        return points;
    }
    chunks(&points, buckets)
        .map(|chunk| chunk[greatest(chunk)])
        .collect()
}

/// The curve with at most `most` points, none of the others further from it than a tolerance: a
/// fifth of a unit of the picture, or as much as `most` needs. `scale` is units of the picture per
/// unit of the axes.
pub fn curve(points: impl IntoIterator<Item = Point>, scale: Point, most: usize) -> Vec<Point> {
    let points = finite(points);
    let scaled: Vec<Point> = points
        .iter()
        .map(|point| (bounded(point.0 * scale.0), bounded(point.1 * scale.1)))
        .collect();
    let mut tolerance = 0.2;
    loop {
        let kept = corners(&scaled, tolerance);
        if kept.len() <= most.max(2) {
            return kept.into_iter().map(|k| points[k]).collect();
        }
        tolerance *= 1.5;
    }
}

/// A coordinate whose square is finite.
fn bounded(coordinate: f64) -> f64 {
    coordinate.clamp(-1e12, 1e12)
}

fn finite(points: impl IntoIterator<Item = Point>) -> Vec<Point> {
    points
        .into_iter()
        .filter(|(x, y)| x.is_finite() && y.is_finite())
        .collect()
}

/// At most `count` runs of points of nearly equal length, none empty.
fn chunks(points: &[Point], count: usize) -> impl Iterator<Item = &[Point]> {
    let count = count.max(1);
    let edge = move |n: usize| n * points.len() / count;
    (0..count)
        .map(move |n| &points[edge(n)..edge(n + 1)])
        .filter(|chunk| !chunk.is_empty())
}

fn least(points: &[Point]) -> usize {
    (0..points.len())
        .min_by(|&a, &b| points[a].1.total_cmp(&points[b].1))
        .unwrap_or(0)
}

fn greatest(points: &[Point]) -> usize {
    (0..points.len())
        .max_by(|&a, &b| points[a].1.total_cmp(&points[b].1))
        .unwrap_or(0)
}

/// Indices that the Ramer-Douglas-Peucker algorithm keeps, ascending.
fn corners(points: &[Point], tolerance: f64) -> Vec<usize> {
    if points.len() < 3 {
        return (0..points.len()).collect();
    }
    let mut keep = vec![false; points.len()];
    let last = points.len() - 1;
    (keep[0], keep[last]) = (true, true);
    let mut spans = vec![(0, last)];
    while let Some((from, to)) = spans.pop() {
        let furthest = (from + 1..to)
            .map(|k| (k, distance(points[k], points[from], points[to])))
            .max_by(|a, b| a.1.total_cmp(&b.1));
        if let Some((k, distance)) = furthest
            && distance > tolerance
        {
            keep[k] = true;
            spans.extend([(from, k), (k, to)]);
        }
    }
    (0..points.len()).filter(|&k| keep[k]).collect()
}

/// Distance of a point from the straight piece between two others.
fn distance(point: Point, from: Point, to: Point) -> f64 {
    let (dx, dy) = (to.0 - from.0, to.1 - from.1);
    let (px, py) = (point.0 - from.0, point.1 - from.1);
    let length = dx * dx + dy * dy;
    let along = if length > 0.0 {
        ((px * dx + py * dy) / length).clamp(0.0, 1.0)
    } else {
        0.0
    };
    (px - along * dx).hypot(py - along * dy)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn noisy() -> Vec<Point> {
        (0..60_000)
            .map(|k| {
                let t = f64::from(k) * 1e-3;
                let spike = match k {
                    12_345 => 9.0,
                    54_321 => -9.0,
                    _ => 0.0,
                };
                (t, (6.3 * t).sin() + 0.1 * (977.0 * t).sin() + spike)
            })
            .collect()
    }

    fn bounds(points: &[Point]) -> Point {
        points.iter().fold((f64::MAX, f64::MIN), |(low, high), p| {
            (low.min(p.1), high.max(p.1))
        })
    }

    #[test]
    fn extremes_keep_minimum_maximum_and_order() {
        let points = noisy();
        let reduced = extremes(points.iter().copied(), 2000);
        assert!(reduced.len() <= 4000);
        assert_eq!(bounds(&reduced), bounds(&points));
        assert!(reduced.is_sorted_by(|a, b| a.0 < b.0));
        assert!(reduced.iter().all(|point| points.contains(point)));
    }

    #[test]
    fn few_points_are_kept_as_they_are() {
        let points = [(0.0, 1.0), (1.0, f64::NAN), (2.0, -1.0)];
        let finite = [(0.0, 1.0), (2.0, -1.0)];
        assert_eq!(extremes(points, 2), finite);
        assert_eq!(maxima(points, 2), finite);
        assert_eq!(curve(points, (1.0, 1.0), 4), finite);
        assert!(extremes([], 2).is_empty() && maxima([], 2).is_empty());
        assert!(curve([], (1.0, 1.0), 4).is_empty());
    }

    #[test]
    fn maxima_keep_the_maximum_and_order() {
        let points = noisy();
        let reduced = maxima(points.iter().copied(), 700);
        assert!(reduced.len() <= 700);
        assert_eq!(bounds(&reduced).1, bounds(&points).1);
        assert!(reduced.is_sorted_by(|a, b| a.0 < b.0));
    }

    #[test]
    fn a_curve_stays_within_the_tolerance() {
        let circle = |k: i32| (f64::from(k) * 1e-3).sin_cos();
        let points: Vec<Point> = (0..20_000).map(circle).collect();
        let reduced = curve(points.iter().copied(), (300.0, 300.0), 4000);
        assert!(reduced.len() < 400, "{}", reduced.len());
        for point in points {
            let nearest = reduced
                .windows(2)
                .map(|pair| distance(point, pair[0], pair[1]))
                .fold(f64::MAX, f64::min);
            assert!(nearest * 300.0 <= 0.21, "{nearest}");
        }
    }
}
