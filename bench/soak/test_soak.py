#!/usr/bin/env python3
"""The watcher of bench/soak reports what is wrong, and nothing else: times, transforms and memory that the test makes."""
import unittest

import numpy

import memory
from ledger import GRACE_S, Anatomy, Ledger, Sweep

CRC, OTHER_CRC = 11, 22


def moved(x, y=0.0, z=0.0):
    T = numpy.eye(4)
    T[:3, 3] = x, y, z
    return T


class Watcher(unittest.TestCase):
    def setUp(self):
        corners = [[x, y, z] for x in (0, 50) for y in (0, 50) for z in (0, 50)]
        self.ledger = Ledger([Anatomy("one", moved(1.0), CRC, corners), Anatomy("other", moved(2.0), OTHER_CRC, corners)])
        self.ledger.add_sweep(Sweep(100.0, 100.5, "one", moved(10.0)))   # the truth is 11 mm
        self.ledger.add_sweep(Sweep(200.0, 200.5, "one", moved(40.0)))   # the truth is 41 mm

    def look(self, begin, end, T):
        for when in numpy.arange(begin, end, 0.1):
            self.ledger.look_up(when, T)

    def kinds(self):
        self.ledger.finish()
        return self.ledger.faults.counts

    def test_what_is_right_is_no_fault(self):
        self.look(99.0, 101.0, None)
        self.ledger.alignment(101.0, 100.5, CRC, moved(11.4))
        self.look(101.0, 201.0, moved(11.4))
        self.ledger.alignment(201.0, 200.5, CRC, moved(41.0, 0.3))
        self.look(201.0, 210.0, moved(41.0, 0.3))
        self.ledger.alignment(210.0, 0.0, 0, None)
        self.look(210.5, 215.0, None)
        self.assertEqual(self.kinds(), {})
        self.assertAlmostEqual(self.ledger.worst_mm, 0.4)
        self.assertEqual(self.ledger.gaps, [])

    def test_a_wrong_transform(self):
        self.ledger.alignment(101.0, 100.5, CRC, moved(11.0))
        self.look(101.0, 110.0, moved(11.0))
        self.ledger.look_up(110.0, moved(11.0, 5.5))
        self.look(110.1, 120.0, moved(11.0))
        self.assertEqual(self.kinds(), {"a wrong transform": 1})

    def test_a_rotation_counts_where_the_kidney_is(self):
        turned = moved(11.0)
        turned[:3, :3] = [[0.98, -0.2, 0.0], [0.2, 0.98, 0.0], [0.0, 0.0, 1.0]]
        self.ledger.alignment(101.0, 100.5, CRC, moved(11.0))
        self.ledger.look_up(105.0, turned)
        self.assertEqual(self.kinds(), {"a wrong transform": 1})

    def test_an_alignment_that_is_over(self):
        self.ledger.alignment(101.0, 100.5, CRC, moved(11.0))
        self.ledger.alignment(201.0, 200.5, CRC, moved(41.0))
        self.ledger.look_up(201.0 + 0.5 * GRACE_S, moved(11.0))
        self.ledger.look_up(201.0 + 2.5 * GRACE_S, moved(11.0))
        self.assertEqual(self.kinds(), {"a wrong transform": 1})

    def test_a_transform_without_an_alignment(self):
        self.ledger.alignment(101.0, 100.5, CRC, moved(11.0))
        self.ledger.alignment(110.0, 0.0, 0, None)
        self.ledger.look_up(120.0, moved(11.0))
        self.assertEqual(self.kinds(), {"a transform without an alignment": 1})

    def test_a_wrong_alignment(self):
        self.ledger.alignment(101.0, 100.5, CRC, moved(11.0, 6.0))
        self.assertEqual(self.kinds(), {"a wrong alignment": 1})

    def test_an_alignment_of_another_ct_or_time(self):
        self.ledger.alignment(101.0, 100.5, OTHER_CRC, moved(12.0))
        self.ledger.alignment(102.0, 150.0, CRC, moved(11.0))
        self.assertEqual(self.kinds(), {"an alignment without truth": 2})

    def test_gaps(self):
        self.ledger.alignment(101.0, 100.5, CRC, moved(11.0))
        self.look(101.0, 110.0, moved(11.0))
        self.look(110.0, 114.0, None)
        self.look(114.0, 120.0, moved(11.0))
        self.assertEqual(self.kinds(), {})
        ((begin, length),) = self.ledger.gaps
        self.assertAlmostEqual(begin, 110.0, delta=0.15)
        self.assertAlmostEqual(length, 4.0, delta=0.15)

    def test_a_lost_alignment(self):
        stored = {"accepted_ns": 5, "translation_m": [1.0, 2.0, 3.0]}
        self.ledger.accepted(stored)
        self.ledger.file({"alignment": stored}, "now")
        self.ledger.file({"alignment": dict(stored, accepted_ns=6, translation_m=[4.0, 5.0, 6.0])}, "a newer one")
        self.assertEqual(self.kinds(), {})
        self.ledger.file(None, "no file")
        self.ledger.file({"alignment": None}, "none")
        self.ledger.file({"alignment": dict(stored, accepted_ns=4)}, "an older one")
        self.ledger.file({"alignment": dict(stored, translation_m=[1.0, 2.0, 3.1])}, "another one")
        self.assertEqual(self.kinds(), {"a lost alignment": 4})

    def test_what_is_offered_after_a_restart(self):
        content = {"alignment": {"accepted_ns": 5, "translation_m": [1.0, 2.0, 3.0]}}
        self.ledger.offered([1.0, 2.0, 3.0], content)
        self.ledger.offered(None, None)
        self.assertEqual(self.kinds(), {})
        self.ledger.offered(None, content)
        self.ledger.offered([1.0, 2.0, 3.5], content)
        self.assertEqual(self.kinds(), {"a lost alignment": 2})


class Memory(unittest.TestCase):
    def growth(self, mib):
        lives = memory.Lives()
        for i in range(300):
            lives.add("node", 1, 2.0 * i, mib(2.0 * i))
        return list(lives.growths())

    def test_a_node_that_grows(self):
        ((name, length, _, _, slope, growth),) = self.growth(lambda s: 50.0 + s / 10.0)
        self.assertEqual((name, length), ("node", 358.0))
        self.assertAlmostEqual(slope, 360.0, delta=1.0)
        self.assertAlmostEqual(growth, 35.8, delta=0.1)

    def test_a_cache_that_fills_and_a_large_message_are_no_growth(self):
        ((_, _, median, peak, _, growth),) = self.growth(lambda s: min(s, 200.0) + (100.0 if int(s) % 50 == 0 else 0.0))
        self.assertAlmostEqual(median, 200.0)
        self.assertAlmostEqual(peak, 300.0)
        self.assertAlmostEqual(growth, 0.0, delta=0.5)

    def test_a_short_life_is_not_judged(self):
        lives = memory.Lives()
        for i in range(200):
            lives.add("node", 1, 2.0 * i, 10.0 + i)
        self.assertEqual(list(lives.growths()), [])


if __name__ == "__main__":
    unittest.main()
