"""Our views as a data set of the BOP benchmark, and estimates in BOP's CSV scored against it.

https://bop.felk.cvut.cz, Hodan et al., "BOP Challenge 2020 on 6D object localization". A model's frame is the frame
of its pose label; files are in millimetres, arrays here in metres.
"""
