"""The documentation's site: pages made of the code, beside those of docs/. Built by `make docs`."""
