//! Disjoint sets (union-find, Tarjan 1975) whose members also have an offset in fringe orders.
//!
//! The offset of a member is its fringe order less that of the representative of its set.

/// The place of a member in its set.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Offset {
    /// The representative, or the number of the set.
    pub(super) set: u32,
    /// Fringe orders by which the member exceeds the representative.
    pub(super) orders: i32,
}

/// Disjoint sets of weighted members. The heavier of two sets gives the representative of their union.
#[derive(Clone, Debug, Default)]
pub(super) struct DisjointSets {
    /// The parent of each member and the offset to it. A representative is its own parent.
    parents: Vec<Offset>,
    weights: Vec<u32>,
    numbers: Vec<u32>,
}

impl DisjointSets {
    /// Resets to one set for each weight, of one member.
    pub(super) fn reset(&mut self, weights: impl Iterator<Item = u32>) {
        self.weights.clear();
        self.weights.extend(weights);
        self.parents.clear();
        self.parents.extend((0..self.weights.len() as u32).map(|set| Offset { set, orders: 0 }));
    }

    /// Unites the sets of `a` and `b`, where `b` exceeds `a` by `order_step` orders. Members of one set keep their
    /// offsets.
    pub(super) fn unite(&mut self, a: u32, b: u32, order_step: i32) {
        let (a, b) = (self.find(a), self.find(b));
        if a.set == b.set {
            return;
        }
        // The offset from the representative of a to that of b.
        let step = a.orders + order_step - b.orders;
        let (heavy, light, orders) = match self.weights[a.set as usize] >= self.weights[b.set as usize] {
            true => (a.set, b.set, step),
            false => (b.set, a.set, -step),
        };
        self.parents[light as usize] = Offset { set: heavy, orders };
        self.weights[heavy as usize] += self.weights[light as usize];
    }

    /// Calls `visit` with each member, the number of its set and its offset to the representative. Sets are numbered in
    /// the order of their first members. Returns the number of sets.
    pub(super) fn number(&mut self, mut visit: impl FnMut(usize, Offset)) -> usize {
        let mut sets = 0;
        self.numbers.clear();
        self.numbers.resize(self.parents.len(), u32::MAX);
        for member in 0..self.parents.len() {
            let Offset { set, orders } = self.find(member as u32);
            let number = &mut self.numbers[set as usize];
            if *number == u32::MAX {
                *number = sets;
                sets += 1;
            }
            visit(member, Offset { set: *number, orders });
        }
        sets as usize
    }

    fn find(&mut self, mut member: u32) -> Offset {
        let mut orders = 0;
        loop {
            let parent = self.parents[member as usize];
            if parent.set == member {
                return Offset { set: member, orders };
            }
            let grandparent = self.parents[parent.set as usize];
            // Path halving: every other member on the way now points to its grandparent. A representative has offset 0.
            let halved = Offset { set: grandparent.set, orders: parent.orders + grandparent.orders };
            self.parents[member as usize] = halved;
            orders += halved.orders;
            member = halved.set;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn members_have_their_set_and_their_offset() {
        let mut sets = DisjointSets::default();
        sets.reset([1, 1, 5, 1, 2, 1].into_iter());
        sets.unite(0, 1, 3);
        sets.unite(1, 2, -1);
        sets.unite(4, 3, 7);
        sets.unite(3, 0, 1);
        // Both are in one set already: a contradiction changes no offset.
        sets.unite(0, 4, 100);
        let mut members = Vec::new();
        assert_eq!(sets.number(|member, offset| members.push((member, offset.set, offset.orders))), 2);
        let relative = |a: usize, b: usize| members[b].2 - members[a].2;
        assert_eq!([0, 1, 2, 3, 4].map(|member| members[member].1), [0; 5]);
        assert_eq!((relative(0, 1), relative(1, 2), relative(4, 3), relative(3, 0)), (3, -1, 7, 1));
        assert_eq!(members[5], (5, 1, 0));
    }
}
