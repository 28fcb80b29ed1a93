//! Disjoint sets (union-find, Tarjan 1975) whose members also know an offset.
//!
//! The members are runs of pixels. The offset is the number of fringe orders by which a run differs from the representative of
//! its set.

/// The place of a member in its set.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Offset {
    /// The representative, or the number of the set.
    pub(super) set: u32,
    /// Offset to the representative.
    pub(super) by: i32,
}

/// Disjoint sets of weighted members. The heavier of two sets gives the representative of their union.
#[derive(Clone, Debug, Default)]
pub(super) struct DisjointSets {
    /// The parent of each member and the offset to it. A representative is its own parent.
    above: Vec<Offset>,
    weight: Vec<u32>,
    numbers: Vec<u32>,
}

impl DisjointSets {
    /// Resets to one set for each weight, of one member.
    pub(super) fn begin(&mut self, weights: impl Iterator<Item = u32>) {
        self.weight.clear();
        self.weight.extend(weights);
        self.above.clear();
        self.above.extend((0..self.weight.len() as u32).map(|member| Offset { set: member, by: 0 }));
    }

    /// Unites the sets of `a` and `b`, where the offset of `b` exceeds that of `a` by `more`. Members of one set keep their offsets.
    pub(super) fn unite(&mut self, a: u32, b: u32, more: i32) {
        let (of_a, of_b) = (self.find(a), self.find(b));
        if of_a.set == of_b.set {
            return;
        }
        // The offset from the representative of a to that of b.
        let more = of_a.by + more - of_b.by;
        let (heavy, light, by) = match self.weight[of_a.set as usize] >= self.weight[of_b.set as usize] {
            true => (of_a.set, of_b.set, more),
            false => (of_b.set, of_a.set, -more),
        };
        self.above[light as usize] = Offset { set: heavy, by };
        self.weight[heavy as usize] += self.weight[light as usize];
    }

    /// Calls `tell` with each member, the number of its set and its offset to the representative. Sets are numbered in the order
    /// of their first members. Returns the number of sets.
    pub(super) fn number(&mut self, mut tell: impl FnMut(usize, Offset)) -> usize {
        let mut sets = 0;
        self.numbers.clear();
        self.numbers.resize(self.above.len(), u32::MAX);
        for member in 0..self.above.len() {
            let Offset { set, by } = self.find(member as u32);
            let number = &mut self.numbers[set as usize];
            if *number == u32::MAX {
                *number = sets;
                sets += 1;
            }
            tell(member, Offset { set: *number, by });
        }
        sets as usize
    }

    fn find(&mut self, mut member: u32) -> Offset {
        let mut by = 0;
        loop {
            let Offset { set, by: more } = self.above[member as usize];
            if set == member {
                return Offset { set, by };
            }
            let Offset { set: next, by: beyond } = self.above[set as usize];
            // Path halving: every other member on the way now points to its grandparent.
            self.above[member as usize] = Offset { set: next, by: more + if next == set { 0 } else { beyond } };
            by += self.above[member as usize].by;
            member = next;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn members_know_their_set_and_their_offset() {
        let mut sets = DisjointSets::default();
        sets.begin([1, 1, 5, 1, 2, 1].into_iter());
        sets.unite(0, 1, 3);
        sets.unite(1, 2, -1);
        sets.unite(4, 3, 7);
        sets.unite(3, 0, 1);
        // Both are in one set already: a contradiction changes nomember.
        sets.unite(0, 4, 100);
        let mut told = Vec::new();
        assert_eq!(sets.number(|member, offset| told.push((member, offset.set, offset.by))), 2);
        let relative = |a: usize, b: usize| told[b].2 - told[a].2;
        assert_eq!([0, 1, 2, 3, 4].map(|member| told[member].1), [0; 5]);
        assert_eq!((relative(0, 1), relative(1, 2), relative(4, 3), relative(3, 0)), (3, -1, 7, 1));
        assert_eq!(told[5], (5, 1, 0));
    }
}
