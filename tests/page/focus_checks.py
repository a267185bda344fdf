# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Whether a page can be used by keyboard. For page_test.py and study_page_test.py."""
TAB = "\ue004"


def check_tab_stops(browser, stops, focused, press_count_max):
    """The Tab key reaches all of `stops`, and whatever it reaches shows that it has the focus.
    `focused`: a script that returns the name of what has the focus, and whether that is seen."""
    reached = {}
    for _ in range(press_count_max):
        browser.press(TAB)
        name, visible = browser.run(focused)
        reached[name] = visible
    missing = stops - set(reached)
    assert not missing, f"the Tab key does not reach {missing}, but {set(reached)}"
    hidden = [name for name, visible in reached.items() if not visible]
    assert not hidden, f"no focus is seen on {hidden}"
