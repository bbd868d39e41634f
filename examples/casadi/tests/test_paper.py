"""The page of the paper's experiments, with peers that raise: they are said in the place of their row."""

import pathlib
import sys
import tempfile
import unittest

import numpy as np

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent / "paper"))

import callbacks  # noqa: E402
import common  # noqa: E402
import page  # noqa: E402

SETTING = "3 s2n1"


def result():
    return common.result(1.0, 10, 0.1, 0.05)


def at_once():
    raise RuntimeError("Invalid_Number_Detected")


def of_a_peer():
    """Like acados' interface: several lines, of which the last says what is wrong."""
    raise RuntimeError("CasADi\nmismatching dimension for field seed_adj with dimension (9, 0)")


class Races(unittest.TestCase):
    def test_what_raises_has_its_message(self):
        twice = iter([result()])
        makers = {
            "sound": lambda: result,
            "not made": of_a_peer,
            "never": lambda: at_once,
            "once": lambda: lambda: next(twice),
        }
        found = common.race(makers, 2, 60.0)
        self.assertEqual(list(found), list(makers))
        self.assertEqual(found["sound"]["runs"], 2)
        self.assertEqual(found["not made"], {"error": "mismatching dimension for field seed_adj with dimension (9, 0)"})
        self.assertEqual(found["never"], {"error": "Invalid_Number_Detected"})
        self.assertEqual(found["once"], {"error": "StopIteration"})


class Pages(unittest.TestCase):
    def write(self, chain, orbit):
        """The page, and the cells of its rows by their first one."""
        with tempfile.TemporaryDirectory() as folder:
            page.PICTURES = pathlib.Path(folder)
            path = page.PICTURES / "paper.md"
            page.write({"chains": {SETTING: chain}, "orbit": orbit, "intervals": {}}, path)
            text = path.read_text()
        rows = [[cell.strip() for cell in line.split("|")[1:-1]] for line in text.splitlines() if line.startswith("|")]
        return text, {row[0]: row[1:] for row in reversed(rows)}

    def results(self, makers):
        return common.race(makers, 1, 60.0)

    def test_a_peer_that_raises_has_a_row(self):
        names = [page.WHOLE, page.HORIZON, page.INTERVALS, page.THEIRS, page.DIRECT, page.INTERIOR]
        sound = {name: lambda: result for name in names}
        chain = self.results(sound | {"acados, call-backs": of_a_peer})
        orbit = self.results(sound | {page.DIRECT: lambda: at_once})
        text, rows = self.write(chain, orbit)
        self.assertEqual(rows["acados, call-backs"], ["raised"])
        self.assertIn("- acados, call-backs (3 masses) raised `mismatching dimension", text)
        self.assertIn("- direct collocation raised `Invalid_Number_Detected`", text)
        self.assertNotIn("of the time of direct collocation", text)

    def test_peers_have_a_section(self):
        sound = {page.THEIRS: lambda: result, page.CALLBACKS: lambda: lambda: common.result(1.0, 10, 0.1, 0.025)}
        runs = {"3 s2n1": self.results(sound), "4 s4n4": self.results(sound | {page.CALLBACKS: of_a_peer})}
        about = {"machine": "a machine", "date": "a day", "load": "1 to 2", "version": "1"}
        text = page.peers({"peers": {"runs": runs, **about}})
        self.assertIn("| 3 masses, s2n1 | 10 (5) · 10 | 10 (2.5) · 10 | 2 | 0.0e+00 |", text)
        self.assertIn("| 4 masses, s4n4 | 10 (5) · 10 | raised |  |  |", text)
        self.assertIn("- acados, call-backs (4 s4n4) raised `mismatching dimension", text)

    def test_everything_raises(self):
        names = [page.WHOLE, page.INTERVALS, page.THEIRS, page.DIRECT, page.INTERIOR]
        raised = self.results(dict.fromkeys(names, at_once))
        text, rows = self.write(raised, raised)
        for name in names:
            self.assertEqual(rows[name][0], "raised")
            self.assertIn(f"- {name} (3 masses) raised `Invalid_Number_Detected`", text)

    def test_nothing_raises(self):
        names = [page.WHOLE, page.HORIZON, page.INTERVALS, page.THEIRS, page.DIRECT, page.INTERIOR]
        sound = self.results({name: lambda: result for name in names})
        text, _ = self.write(sound, sound)
        self.assertNotIn("raised", text)
        self.assertIn("of the time of direct collocation", text)


class Solver:
    """As strict about lengths as acados' interface."""

    def __init__(self, length):
        self.length = length

    def set(self, field, value):
        if value.shape != (self.length,):
            raise Exception(f"mismatching dimension for field {field} with dimension {(self.length, 0)}")  # noqa: TRY002


class Seeds(unittest.TestCase):
    def test_both_lengths(self):
        nx, nu = 9, 3
        for length in [nx, nx + nu]:
            zeros = callbacks.zeros_of_seed(Solver(length), nx, nu)
            Solver(length).set("seed_adj", np.append(np.ones(nx), zeros))
        with self.assertRaisesRegex(Exception, "mismatching dimension"):
            callbacks.zeros_of_seed(Solver(nx + 1), nx, nu)


if __name__ == "__main__":
    unittest.main()
