"""Parts of ovens and microwaves: cases, control panels, racks, turntables."""
