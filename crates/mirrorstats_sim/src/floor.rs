//! A floor plan: where an upright cylinder may stand and pass.
//!
//! Rule: a move is a straight line, and the whole line must be clear, not only its end.

/// An obstacle with its sides along the walls.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Square {
    /// Its centre, m.
    pub center: [f64; 2],
    /// Half of its edge, m.
    pub half: f64,
}

impl Square {
    /// The distance of a point from the nearest side; 0 inside, m.
    pub fn distance(&self, point: [f64; 2]) -> f64 {
        let [dx, dy] = [0, 1].map(|axis| ((point[axis] - self.center[axis]).abs() - self.half).max(0.0));
        (dx * dx + dy * dy).sqrt()
    }

    /// The distance of a line from the nearest side; 0 if they cross, m.
    fn distance_to_line(&self, from: [f64; 2], to: [f64; 2]) -> f64 {
        if self.is_crossed(from, to) {
            return 0.0;
        }
        let corners = [[-1.0, -1.0], [-1.0, 1.0], [1.0, -1.0], [1.0, 1.0]];
        let of_corners = corners.into_iter().map(|[right, up]| {
            distance_to_line([self.center[0] + right * self.half, self.center[1] + up * self.half], from, to)
        });
        of_corners.fold(self.distance(from).min(self.distance(to)), f64::min)
    }

    fn is_crossed(&self, from: [f64; 2], to: [f64; 2]) -> bool {
        let (mut enters, mut leaves) = (0.0_f64, 1.0_f64);
        for axis in 0..2 {
            let along = to[axis] - from[axis];
            let [low, high] = [-self.half, self.half].map(|side| self.center[axis] + side - from[axis]);
            if along.abs() < f64::MIN_POSITIVE {
                if low > 0.0 || high < 0.0 {
                    return false;
                }
                continue;
            }
            let (near, far) = if along > 0.0 { (low / along, high / along) } else { (high / along, low / along) };
            enters = enters.max(near);
            leaves = leaves.min(far);
        }
        enters <= leaves
    }
}

pub(crate) fn distance_to_line(point: [f64; 2], from: [f64; 2], to: [f64; 2]) -> f64 {
    let along = [to[0] - from[0], to[1] - from[1]];
    let length = along[0] * along[0] + along[1] * along[1];
    let offset = [point[0] - from[0], point[1] - from[1]];
    let share =
        if length > 0.0 { ((offset[0] * along[0] + offset[1] * along[1]) / length).clamp(0.0, 1.0) } else { 0.0 };
    let gap = [offset[0] - share * along[0], offset[1] - share * along[1]];
    (gap[0] * gap[0] + gap[1] * gap[1]).sqrt()
}

pub fn distance(a: [f64; 2], b: [f64; 2]) -> f64 {
    let [dx, dy] = [a[0] - b[0], a[1] - b[1]];
    (dx * dx + dy * dy).sqrt()
}

#[derive(Clone, Debug, PartialEq)]
pub struct FloorPlan {
    /// The largest distance of a body's axis from the centre along each axis, m.
    pub reach: f64,
    /// Of a body's cylinder, m.
    pub radius: f64,
    /// Every cube that stands on the floor.
    pub squares: Vec<Square>,
}

impl FloorPlan {
    /// Returns true if a body's axis may be at a point, `clearance` more than touching away from cubes.
    pub fn admits(&self, spot: [f64; 2], clearance: f64) -> bool {
        spot.iter().all(|at| at.abs() <= self.reach)
            && self.squares.iter().all(|square| square.distance(spot) >= self.radius + clearance)
    }

    pub(crate) fn is_passable(&self, from: [f64; 2], to: [f64; 2]) -> bool {
        to.iter().all(|at| at.abs() <= self.reach)
            && self.squares.iter().all(|square| square.distance_to_line(from, to) >= self.radius)
    }

    /// Returns true if a body moving straight from one point to another touches a body at `other`.
    pub(crate) fn is_blocked_by(&self, from: [f64; 2], to: [f64; 2], other: [f64; 2]) -> bool {
        distance_to_line(other, from, to) < 2.0 * self.radius
    }
}

#[cfg(test)]
mod tests {
    use super::{FloorPlan, Square, distance_to_line};

    fn plan() -> FloorPlan {
        FloorPlan { reach: 3.5, radius: 0.4, squares: vec![Square { center: [1.0, 0.0], half: 0.25 }] }
    }

    #[test]
    fn cubes_and_walls_stop_a_body_where_it_touches() {
        let plan = plan();
        assert!(plan.is_passable([0.0, 0.0], [0.34, 0.0]));
        assert!(!plan.is_passable([0.0, 0.0], [0.36, 0.0]));
        assert!(plan.is_passable([3.2, 2.0], [3.5, 2.0]));
        assert!(!plan.is_passable([3.2, 2.0], [3.51, 2.0]));
    }

    #[test]
    fn no_move_jumps_over_a_cube_or_cuts_its_corner() {
        let plan = plan();
        assert!(!plan.is_passable([0.0, 0.0], [3.0, 0.0]));
        assert!(!plan.is_passable([0.2, 0.3], [1.0, 0.9]), "both ends are clear, the corner is not");
        assert!(plan.admits([0.2, 0.3], 0.0) && plan.admits([1.0, 0.9], 0.0));
    }

    #[test]
    fn bodies_block_along_the_whole_way() {
        let plan = plan();
        assert!(plan.is_blocked_by([0.0, 0.0], [2.0, 0.0], [1.0, 0.79]));
        assert!(!plan.is_blocked_by([0.0, 0.0], [2.0, 0.0], [1.0, 0.81]));
    }

    #[test]
    fn a_line_of_no_length_is_a_point() {
        assert!((distance_to_line([3.0, 4.0], [0.0, 0.0], [0.0, 0.0]) - 5.0).abs() < 1e-15);
    }
}
