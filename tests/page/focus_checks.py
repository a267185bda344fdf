# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Keyboard access to a page. For page_test.py and study_page_test.py."""
TAB = "\ue004"


def check_tab_stops(browser, stops, focused, press_count_max):
    """The Tab key reaches all of `stops`, and each element it reaches shows its focus. `focused`: a
    script that returns the name of the focused element, and whether the focus is visible.
    """
    reached = {}
    for _ in range(press_count_max):
        browser.press(TAB)
        name, visible = browser.run(focused)
        reached[name] = visible
    missing = stops - set(reached)
    assert not missing, f"the Tab key does not reach {missing}, but {set(reached)}"
    hidden = [name for name, visible in reached.items() if not visible]
    assert not hidden, f"no focus is seen on {hidden}"
