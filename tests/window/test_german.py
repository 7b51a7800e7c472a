"""German labels in a real window: each fits into the room that its row has."""

PLAYED = {"script": "look_in_german.py", "size": (1000, 700)}


def test_no_german_or_english_label_of_a_panel_is_longer_than_its_row(seen):
    needs = [need for need, _ in seen["drawn"].values()]
    assert (len(needs) >= 50, min(needs) > 0.0) == (True, True)
    assert [name for name, (need, room) in seen["drawn"].items() if need > room] == []


def test_buttons_are_german_and_the_names_of_objects_are_not(seen):
    texts = set(seen["texts"])
    assert texts >= {"Digital Clay hinzufügen", "Druckkörper hinzufügen", "Cube"}
    assert not texts & {"Add Digital Clay", "Add Presser", "Würfel"}
