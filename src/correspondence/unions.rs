//! Sets of runs of pixels that were found to belong together, of which each knows by how many orders it differs from the one that
//! names its set.

/// A thing in its set.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Offset {
    pub(super) set: u32,
    /// What it has more than the thing that names the set.
    pub(super) by: i32,
}

/// Sets of things that are counted; the heavier of two sets names both.
#[derive(Clone, Debug, Default)]
pub(super) struct Unions {
    /// The thing above each, itself for one that names its set, and what it has more than that.
    above: Vec<Offset>,
    weight: Vec<u32>,
    numbers: Vec<u32>,
}

impl Unions {
    /// Things of such weights instead of all before, each by itself.
    pub(super) fn begin(&mut self, weights: impl Iterator<Item = u32>) {
        self.weight.clear();
        self.weight.extend(weights);
        self.above.clear();
        self.above.extend((0..self.weight.len() as u32).map(|thing| Offset { set: thing, by: 0 }));
    }

    /// Makes the sets of two things one, of which `b` has so much more than `a`; what was known before stays.
    pub(super) fn unite(&mut self, a: u32, b: u32, more: i32) {
        let (of_a, of_b) = (self.find(a), self.find(b));
        if of_a.set == of_b.set {
            return;
        }
        // What the name of b's set has more than that of a's.
        let more = of_a.by + more - of_b.by;
        let (heavy, light, by) = match self.weight[of_a.set as usize] >= self.weight[of_b.set as usize] {
            true => (of_a.set, of_b.set, more),
            false => (of_b.set, of_a.set, -more),
        };
        self.above[light as usize] = Offset { set: heavy, by };
        self.weight[heavy as usize] += self.weight[light as usize];
    }

    /// Tells of each thing its set, numbered in the order of their first things, and what it has more than the name of the set.
    /// Yields the number of sets.
    pub(super) fn number(&mut self, mut tell: impl FnMut(usize, Offset)) -> usize {
        let mut sets = 0;
        self.numbers.clear();
        self.numbers.resize(self.above.len(), u32::MAX);
        for thing in 0..self.above.len() {
            let Offset { set, by } = self.find(thing as u32);
            let number = &mut self.numbers[set as usize];
            if *number == u32::MAX {
                *number = sets;
                sets += 1;
            }
            tell(thing, Offset { set: *number, by });
        }
        sets as usize
    }

    fn find(&mut self, mut thing: u32) -> Offset {
        let mut by = 0;
        loop {
            let Offset { set, by: more } = self.above[thing as usize];
            if set == thing {
                return Offset { set, by };
            }
            let Offset { set: next, by: beyond } = self.above[set as usize];
            // Every other step on the way points further up from now on.
            self.above[thing as usize] = Offset { set: next, by: more + if next == set { 0 } else { beyond } };
            by += self.above[thing as usize].by;
            thing = next;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn things_know_their_set_and_their_offset() {
        let mut unions = Unions::default();
        unions.begin([1, 1, 5, 1, 2, 1].into_iter());
        unions.unite(0, 1, 3);
        unions.unite(1, 2, -1);
        unions.unite(4, 3, 7);
        unions.unite(3, 0, 1);
        // Known already: a contradiction changes nothing.
        unions.unite(0, 4, 100);
        let mut told = Vec::new();
        assert_eq!(unions.number(|thing, offset| told.push((thing, offset.set, offset.by))), 2);
        let relative = |a: usize, b: usize| told[b].2 - told[a].2;
        assert_eq!([0, 1, 2, 3, 4].map(|thing| told[thing].1), [0; 5]);
        assert_eq!((relative(0, 1), relative(1, 2), relative(4, 3), relative(3, 0)), (3, -1, 7, 1));
        assert_eq!(told[5], (5, 1, 0));
    }
}
