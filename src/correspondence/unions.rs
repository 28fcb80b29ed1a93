//! Sets of runs of pixels that were found to belong together.

/// Sets of things that are counted; each set is named by the first of them.
#[derive(Clone, Debug, Default)]
pub(super) struct Unions(Vec<u32>);

impl Unions {
    /// So many things instead of all before, each by itself.
    pub(super) fn begin(&mut self, count: usize) {
        self.0.clear();
        self.0.extend(0..count as u32);
    }

    /// Makes the sets of two things one.
    pub(super) fn unite(&mut self, a: usize, b: usize) {
        let (a, b) = (self.name(a), self.name(b));
        self.0[a.max(b)] = a.min(b) as u32;
    }

    /// For each thing the number of its set, into `numbers`; sets are numbered in the order of their first things.
    pub(super) fn number(&mut self, numbers: &mut Vec<u32>) {
        numbers.clear();
        numbers.reserve(self.0.len());
        let mut sets = 0;
        for thing in 0..self.0.len() {
            let name = self.name(thing);
            numbers.push(if name == thing { sets } else { numbers[name] });
            sets += u32::from(name == thing);
        }
    }

    fn name(&mut self, mut thing: usize) -> usize {
        while self.0[thing] as usize != thing {
            self.0[thing] = self.0[self.0[thing] as usize];
            thing = self.0[thing] as usize;
        }
        thing
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sets_are_numbered_by_their_first_things() {
        let mut unions = Unions::default();
        unions.begin(2);
        unions.unite(0, 1);
        unions.begin(7);
        unions.unite(5, 2);
        unions.unite(6, 5);
        unions.unite(1, 3);
        let mut numbers = Vec::new();
        unions.number(&mut numbers);
        assert_eq!(numbers, [0, 1, 2, 1, 3, 2, 2]);
    }
}
