"""Explicit pairs with rational coefficients: the first weights advance the solution, the embedded ones estimate.

A name such as ``fehlberg45`` carries the pair's customary digits, so the order of the advancing weights is said in
each description.
"""

from __future__ import annotations

from integrators.methods.catalogue.explicit import explicit_entry

METHODS = (
    explicit_entry(
        "merson4",
        4,
        ("1/3", "1/6 1/6", "1/8 0 3/8", "1/2 0 -3/2 2"),
        "1/6 0 0 2/3 1/6",
        "order 4 with embedded order 3, or 5 on linear problems with constant coefficients",
        "R. H. Merson, Proc. Symp. Data Processing, Salisbury (1957); Hairer, Nørsett, Wanner, "
        "Solving Ordinary Differential Equations I, Table II.4.1, doi:10.1007/978-3-540-78862-1",
        aliases=("merson", "kutta-merson"),
        embedded=("1/10 0 3/10 2/5 1/5",),
    ),
    explicit_entry(
        "bogacki-shampine32",
        3,
        ("1/2", "0 3/4", "2/9 1/3 4/9"),
        "2/9 1/3 4/9 0",
        "order 3 with embedded order 2; the last stage is the next step's first",
        "P. Bogacki, L. F. Shampine, Appl. Math. Lett. 2 (1989) 321–325, doi:10.1016/0893-9659(89)90079-7",
        aliases=("bs32",),
        embedded=("7/24 1/4 1/3 1/8",),
    ),
    explicit_entry(
        "fehlberg45",
        4,
        (
            "1/4",
            "3/32 9/32",
            "1932/2197 -7200/2197 7296/2197",
            "439/216 -8 3680/513 -845/4104",
            "-8/27 2 -3544/2565 1859/4104 -11/40",
        ),
        "25/216 0 1408/2565 2197/4104 -1/5 0",
        "order 4, as Fehlberg advances it, with embedded order 5",
        "E. Fehlberg, NASA TR R-315 (1969)",
        aliases=("rkf45",),
        embedded=("16/135 0 6656/12825 28561/56430 -9/50 2/55",),
    ),
    explicit_entry(
        "cash-karp45",
        5,
        (
            "1/5",
            "3/40 9/40",
            "3/10 -9/10 6/5",
            "-11/54 5/2 -70/27 35/27",
            "1631/55296 175/512 575/13824 44275/110592 253/4096",
        ),
        "37/378 0 250/621 125/594 0 512/1771",
        "order 5, as Cash and Karp advance it, with embedded order 4",
        "J. R. Cash, A. H. Karp, ACM Trans. Math. Softw. 16 (1990) 201–222, doi:10.1145/79505.79507",
        aliases=("cash-karp54", "cash-karp"),
        embedded=("2825/27648 0 18575/48384 13525/55296 277/14336 1/4",),
    ),
    explicit_entry(
        "dormand-prince54",
        5,
        (
            "1/5",
            "3/40 9/40",
            "44/45 -56/15 32/9",
            "19372/6561 -25360/2187 64448/6561 -212/729",
            "9017/3168 -355/33 46732/5247 49/176 -5103/18656",
            "35/384 0 500/1113 125/192 -2187/6784 11/84",
        ),
        "35/384 0 500/1113 125/192 -2187/6784 11/84 0",
        "order 5 with embedded order 4; the last stage is the next step's first",
        "J. R. Dormand, P. J. Prince, J. Comput. Appl. Math. 6 (1980) 19–26, doi:10.1016/0771-050X(80)90013-3",
        aliases=("dopri5", "dormand-prince"),
        embedded=("5179/57600 0 7571/16695 393/640 -92097/339200 187/2100 1/40",),
    ),
    explicit_entry(
        "verner65",
        6,
        (
            "1/6",
            "4/75 16/75",
            "5/6 -8/3 5/2",
            "-165/64 55/6 -425/64 85/96",
            "12/5 -8 4015/612 -11/36 88/255",
            "-8263/15000 124/75 -643/680 -81/250 2484/10625 0",
            "3501/1720 -300/43 297275/52632 -319/2322 24068/84065 0 3850/26703",
        ),
        "3/40 0 875/2244 23/72 264/1955 0 125/11592 43/616",
        "order 6 with embedded order 5: Verner's pair of 1978 with eight stages, used in the code DVERK",
        "J. H. Verner, SIAM J. Numer. Anal. 15 (1978) 772–790, doi:10.1137/0715051",
        aliases=("dverk",),
        embedded=("13/160 0 2375/5984 5/16 12/85 3/44 0 0",),
    ),
)
