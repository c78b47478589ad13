"""Changes claimed within a first traversal in which nothing changes."""

from dataclasses import replace

import pytest

from supermap_cli.evaluation.claimed_changes import claimed_changes
from supermap_cli.evaluation.estimate import EstimatedEvent
from support import evaluated as e


def claiming(truth, *events):
    return replace(e.perfect_map(truth), events=tuple(EstimatedEvent(*event) for event in events))


def moved(at, label="chair"):
    return ("moved", f"{label}-1", label, e.ns(at))


def test_every_claim_about_a_still_life_counts():
    truth = e.still_life()
    assert claimed_changes(claiming(truth), truth) == ()
    (claim,) = claimed_changes(claiming(truth, moved(4)), truth)
    assert (claim.kind, claim.instance_id, claim.label) == ("moved", "chair-1", "chair")


def test_a_person_may_come_and_go():
    truth = e.still_life()
    assert claimed_changes(claiming(truth, moved(4, "person")), truth) == ()


def test_claims_of_a_later_visit_are_left_to_its_diff():
    truth = e.two_days()
    assert claimed_changes(claiming(truth, moved(104)), truth) == ()


@pytest.mark.parametrize("at", [0, 4, 9])
def test_where_something_changes_within_the_visit_nothing_is_counted(at):
    objects = (e.thing("bag-1", e.stay((0, 0, 0.2), until=at), e.stay((3, 0, 0.2), since=at)),)
    truth = e.world(objects, [e.traversal("monday", 0, 9, objects)])
    assert claimed_changes(claiming(truth, moved(4)), truth) is None
