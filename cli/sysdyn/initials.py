"""`__init__` of values of 1 to 33 fields: each field is set by what its slot is set by.

`sysdyn.values` gives a copy of one of these to each class, with the names of its fields for a0, a1, ...; its
globals are s0, s1, ...: `__set__` of its slots.
"""

# fmt: off
# ruff: noqa: E702, F821
# mypy: ignore-errors


def _1(self, a0):
    s0(self, a0)


def _2(self, a0, a1):
    s0(self, a0); s1(self, a1)


def _3(self, a0, a1, a2):
    s0(self, a0); s1(self, a1); s2(self, a2)


def _4(self, a0, a1, a2, a3):
    s0(self, a0); s1(self, a1); s2(self, a2); s3(self, a3)


def _5(self, a0, a1, a2, a3, a4):
    s0(self, a0); s1(self, a1); s2(self, a2); s3(self, a3); s4(self, a4)


def _6(self, a0, a1, a2, a3, a4, a5):
    s0(self, a0); s1(self, a1); s2(self, a2); s3(self, a3); s4(self, a4); s5(self, a5)


def _7(self, a0, a1, a2, a3, a4, a5, a6):
    s0(self, a0); s1(self, a1); s2(self, a2); s3(self, a3); s4(self, a4); s5(self, a5); s6(self, a6)


def _8(self, a0, a1, a2, a3, a4, a5, a6, a7):
    s0(self, a0); s1(self, a1); s2(self, a2); s3(self, a3); s4(self, a4); s5(self, a5); s6(self, a6); s7(self, a7)


def _9(self, a0, a1, a2, a3, a4, a5, a6, a7, a8):
    s0(self, a0); s1(self, a1); s2(self, a2); s3(self, a3); s4(self, a4); s5(self, a5); s6(self, a6); s7(self, a7)
    s8(self, a8)


def _10(self, a0, a1, a2, a3, a4, a5, a6, a7, a8, a9):
    s0(self, a0); s1(self, a1); s2(self, a2); s3(self, a3); s4(self, a4); s5(self, a5); s6(self, a6); s7(self, a7)
    s8(self, a8); s9(self, a9)


def _11(self, a0, a1, a2, a3, a4, a5, a6, a7, a8, a9, a10):
    s0(self, a0); s1(self, a1); s2(self, a2); s3(self, a3); s4(self, a4); s5(self, a5); s6(self, a6); s7(self, a7)
    s8(self, a8); s9(self, a9); s10(self, a10)


def _12(self, a0, a1, a2, a3, a4, a5, a6, a7, a8, a9, a10, a11):
    s0(self, a0); s1(self, a1); s2(self, a2); s3(self, a3); s4(self, a4); s5(self, a5); s6(self, a6); s7(self, a7)
    s8(self, a8); s9(self, a9); s10(self, a10); s11(self, a11)


def _13(self, a0, a1, a2, a3, a4, a5, a6, a7, a8, a9, a10, a11, a12):
    s0(self, a0); s1(self, a1); s2(self, a2); s3(self, a3); s4(self, a4); s5(self, a5); s6(self, a6); s7(self, a7)
    s8(self, a8); s9(self, a9); s10(self, a10); s11(self, a11); s12(self, a12)


def _14(self, a0, a1, a2, a3, a4, a5, a6, a7, a8, a9, a10, a11, a12, a13):
    s0(self, a0); s1(self, a1); s2(self, a2); s3(self, a3); s4(self, a4); s5(self, a5); s6(self, a6); s7(self, a7)
    s8(self, a8); s9(self, a9); s10(self, a10); s11(self, a11); s12(self, a12); s13(self, a13)


def _15(self, a0, a1, a2, a3, a4, a5, a6, a7, a8, a9, a10, a11, a12, a13, a14):
    s0(self, a0); s1(self, a1); s2(self, a2); s3(self, a3); s4(self, a4); s5(self, a5); s6(self, a6); s7(self, a7)
    s8(self, a8); s9(self, a9); s10(self, a10); s11(self, a11); s12(self, a12); s13(self, a13); s14(self, a14)


def _16(self, a0, a1, a2, a3, a4, a5, a6, a7, a8, a9, a10, a11, a12, a13, a14, a15):
    s0(self, a0); s1(self, a1); s2(self, a2); s3(self, a3); s4(self, a4); s5(self, a5); s6(self, a6); s7(self, a7)
    s8(self, a8); s9(self, a9); s10(self, a10); s11(self, a11); s12(self, a12); s13(self, a13); s14(self, a14)
    s15(self, a15)


def _17(self, a0, a1, a2, a3, a4, a5, a6, a7, a8, a9, a10, a11, a12, a13, a14, a15, a16):
    s0(self, a0); s1(self, a1); s2(self, a2); s3(self, a3); s4(self, a4); s5(self, a5); s6(self, a6); s7(self, a7)
    s8(self, a8); s9(self, a9); s10(self, a10); s11(self, a11); s12(self, a12); s13(self, a13); s14(self, a14)
    s15(self, a15); s16(self, a16)


def _18(self, a0, a1, a2, a3, a4, a5, a6, a7, a8, a9, a10, a11, a12, a13, a14, a15, a16, a17):
    s0(self, a0); s1(self, a1); s2(self, a2); s3(self, a3); s4(self, a4); s5(self, a5); s6(self, a6); s7(self, a7)
    s8(self, a8); s9(self, a9); s10(self, a10); s11(self, a11); s12(self, a12); s13(self, a13); s14(self, a14)
    s15(self, a15); s16(self, a16); s17(self, a17)


def _19(self, a0, a1, a2, a3, a4, a5, a6, a7, a8, a9, a10, a11, a12, a13, a14, a15, a16, a17, a18):
    s0(self, a0); s1(self, a1); s2(self, a2); s3(self, a3); s4(self, a4); s5(self, a5); s6(self, a6); s7(self, a7)
    s8(self, a8); s9(self, a9); s10(self, a10); s11(self, a11); s12(self, a12); s13(self, a13); s14(self, a14)
    s15(self, a15); s16(self, a16); s17(self, a17); s18(self, a18)


def _20(self, a0, a1, a2, a3, a4, a5, a6, a7, a8, a9, a10, a11, a12, a13, a14, a15, a16, a17, a18, a19):
    s0(self, a0); s1(self, a1); s2(self, a2); s3(self, a3); s4(self, a4); s5(self, a5); s6(self, a6); s7(self, a7)
    s8(self, a8); s9(self, a9); s10(self, a10); s11(self, a11); s12(self, a12); s13(self, a13); s14(self, a14)
    s15(self, a15); s16(self, a16); s17(self, a17); s18(self, a18); s19(self, a19)


def _21(self, a0, a1, a2, a3, a4, a5, a6, a7, a8, a9, a10, a11, a12, a13, a14, a15, a16, a17, a18, a19, a20):
    s0(self, a0); s1(self, a1); s2(self, a2); s3(self, a3); s4(self, a4); s5(self, a5); s6(self, a6); s7(self, a7)
    s8(self, a8); s9(self, a9); s10(self, a10); s11(self, a11); s12(self, a12); s13(self, a13); s14(self, a14)
    s15(self, a15); s16(self, a16); s17(self, a17); s18(self, a18); s19(self, a19); s20(self, a20)


def _22(self, a0, a1, a2, a3, a4, a5, a6, a7, a8, a9, a10, a11, a12, a13, a14, a15, a16, a17, a18, a19, a20, a21):
    s0(self, a0); s1(self, a1); s2(self, a2); s3(self, a3); s4(self, a4); s5(self, a5); s6(self, a6); s7(self, a7)
    s8(self, a8); s9(self, a9); s10(self, a10); s11(self, a11); s12(self, a12); s13(self, a13); s14(self, a14)
    s15(self, a15); s16(self, a16); s17(self, a17); s18(self, a18); s19(self, a19); s20(self, a20); s21(self, a21)


def _23(self, a0, a1, a2, a3, a4, a5, a6, a7, a8, a9, a10, a11, a12, a13, a14, a15, a16, a17, a18, a19, a20, a21,
        a22):
    s0(self, a0); s1(self, a1); s2(self, a2); s3(self, a3); s4(self, a4); s5(self, a5); s6(self, a6); s7(self, a7)
    s8(self, a8); s9(self, a9); s10(self, a10); s11(self, a11); s12(self, a12); s13(self, a13); s14(self, a14)
    s15(self, a15); s16(self, a16); s17(self, a17); s18(self, a18); s19(self, a19); s20(self, a20); s21(self, a21)
    s22(self, a22)


def _24(self, a0, a1, a2, a3, a4, a5, a6, a7, a8, a9, a10, a11, a12, a13, a14, a15, a16, a17, a18, a19, a20, a21, a22,
        a23):
    s0(self, a0); s1(self, a1); s2(self, a2); s3(self, a3); s4(self, a4); s5(self, a5); s6(self, a6); s7(self, a7)
    s8(self, a8); s9(self, a9); s10(self, a10); s11(self, a11); s12(self, a12); s13(self, a13); s14(self, a14)
    s15(self, a15); s16(self, a16); s17(self, a17); s18(self, a18); s19(self, a19); s20(self, a20); s21(self, a21)
    s22(self, a22); s23(self, a23)


def _25(self, a0, a1, a2, a3, a4, a5, a6, a7, a8, a9, a10, a11, a12, a13, a14, a15, a16, a17, a18, a19, a20, a21, a22,
        a23, a24):
    s0(self, a0); s1(self, a1); s2(self, a2); s3(self, a3); s4(self, a4); s5(self, a5); s6(self, a6); s7(self, a7)
    s8(self, a8); s9(self, a9); s10(self, a10); s11(self, a11); s12(self, a12); s13(self, a13); s14(self, a14)
    s15(self, a15); s16(self, a16); s17(self, a17); s18(self, a18); s19(self, a19); s20(self, a20); s21(self, a21)
    s22(self, a22); s23(self, a23); s24(self, a24)


def _26(self, a0, a1, a2, a3, a4, a5, a6, a7, a8, a9, a10, a11, a12, a13, a14, a15, a16, a17, a18, a19, a20, a21, a22,
        a23, a24, a25):
    s0(self, a0); s1(self, a1); s2(self, a2); s3(self, a3); s4(self, a4); s5(self, a5); s6(self, a6); s7(self, a7)
    s8(self, a8); s9(self, a9); s10(self, a10); s11(self, a11); s12(self, a12); s13(self, a13); s14(self, a14)
    s15(self, a15); s16(self, a16); s17(self, a17); s18(self, a18); s19(self, a19); s20(self, a20); s21(self, a21)
    s22(self, a22); s23(self, a23); s24(self, a24); s25(self, a25)


def _27(self, a0, a1, a2, a3, a4, a5, a6, a7, a8, a9, a10, a11, a12, a13, a14, a15, a16, a17, a18, a19, a20, a21, a22,
        a23, a24, a25, a26):
    s0(self, a0); s1(self, a1); s2(self, a2); s3(self, a3); s4(self, a4); s5(self, a5); s6(self, a6); s7(self, a7)
    s8(self, a8); s9(self, a9); s10(self, a10); s11(self, a11); s12(self, a12); s13(self, a13); s14(self, a14)
    s15(self, a15); s16(self, a16); s17(self, a17); s18(self, a18); s19(self, a19); s20(self, a20); s21(self, a21)
    s22(self, a22); s23(self, a23); s24(self, a24); s25(self, a25); s26(self, a26)


def _28(self, a0, a1, a2, a3, a4, a5, a6, a7, a8, a9, a10, a11, a12, a13, a14, a15, a16, a17, a18, a19, a20, a21, a22,
        a23, a24, a25, a26, a27):
    s0(self, a0); s1(self, a1); s2(self, a2); s3(self, a3); s4(self, a4); s5(self, a5); s6(self, a6); s7(self, a7)
    s8(self, a8); s9(self, a9); s10(self, a10); s11(self, a11); s12(self, a12); s13(self, a13); s14(self, a14)
    s15(self, a15); s16(self, a16); s17(self, a17); s18(self, a18); s19(self, a19); s20(self, a20); s21(self, a21)
    s22(self, a22); s23(self, a23); s24(self, a24); s25(self, a25); s26(self, a26); s27(self, a27)


def _29(self, a0, a1, a2, a3, a4, a5, a6, a7, a8, a9, a10, a11, a12, a13, a14, a15, a16, a17, a18, a19, a20, a21, a22,
        a23, a24, a25, a26, a27, a28):
    s0(self, a0); s1(self, a1); s2(self, a2); s3(self, a3); s4(self, a4); s5(self, a5); s6(self, a6); s7(self, a7)
    s8(self, a8); s9(self, a9); s10(self, a10); s11(self, a11); s12(self, a12); s13(self, a13); s14(self, a14)
    s15(self, a15); s16(self, a16); s17(self, a17); s18(self, a18); s19(self, a19); s20(self, a20); s21(self, a21)
    s22(self, a22); s23(self, a23); s24(self, a24); s25(self, a25); s26(self, a26); s27(self, a27); s28(self, a28)


def _30(self, a0, a1, a2, a3, a4, a5, a6, a7, a8, a9, a10, a11, a12, a13, a14, a15, a16, a17, a18, a19, a20, a21, a22,
        a23, a24, a25, a26, a27, a28, a29):
    s0(self, a0); s1(self, a1); s2(self, a2); s3(self, a3); s4(self, a4); s5(self, a5); s6(self, a6); s7(self, a7)
    s8(self, a8); s9(self, a9); s10(self, a10); s11(self, a11); s12(self, a12); s13(self, a13); s14(self, a14)
    s15(self, a15); s16(self, a16); s17(self, a17); s18(self, a18); s19(self, a19); s20(self, a20); s21(self, a21)
    s22(self, a22); s23(self, a23); s24(self, a24); s25(self, a25); s26(self, a26); s27(self, a27); s28(self, a28)
    s29(self, a29)


def _31(self, a0, a1, a2, a3, a4, a5, a6, a7, a8, a9, a10, a11, a12, a13, a14, a15, a16, a17, a18, a19, a20, a21, a22,
        a23, a24, a25, a26, a27, a28, a29, a30):
    s0(self, a0); s1(self, a1); s2(self, a2); s3(self, a3); s4(self, a4); s5(self, a5); s6(self, a6); s7(self, a7)
    s8(self, a8); s9(self, a9); s10(self, a10); s11(self, a11); s12(self, a12); s13(self, a13); s14(self, a14)
    s15(self, a15); s16(self, a16); s17(self, a17); s18(self, a18); s19(self, a19); s20(self, a20); s21(self, a21)
    s22(self, a22); s23(self, a23); s24(self, a24); s25(self, a25); s26(self, a26); s27(self, a27); s28(self, a28)
    s29(self, a29); s30(self, a30)


def _32(self, a0, a1, a2, a3, a4, a5, a6, a7, a8, a9, a10, a11, a12, a13, a14, a15, a16, a17, a18, a19, a20, a21, a22,
        a23, a24, a25, a26, a27, a28, a29, a30, a31):
    s0(self, a0); s1(self, a1); s2(self, a2); s3(self, a3); s4(self, a4); s5(self, a5); s6(self, a6); s7(self, a7)
    s8(self, a8); s9(self, a9); s10(self, a10); s11(self, a11); s12(self, a12); s13(self, a13); s14(self, a14)
    s15(self, a15); s16(self, a16); s17(self, a17); s18(self, a18); s19(self, a19); s20(self, a20); s21(self, a21)
    s22(self, a22); s23(self, a23); s24(self, a24); s25(self, a25); s26(self, a26); s27(self, a27); s28(self, a28)
    s29(self, a29); s30(self, a30); s31(self, a31)


def _33(self, a0, a1, a2, a3, a4, a5, a6, a7, a8, a9, a10, a11, a12, a13, a14, a15, a16, a17, a18, a19, a20, a21, a22,
        a23, a24, a25, a26, a27, a28, a29, a30, a31, a32):
    s0(self, a0); s1(self, a1); s2(self, a2); s3(self, a3); s4(self, a4); s5(self, a5); s6(self, a6); s7(self, a7)
    s8(self, a8); s9(self, a9); s10(self, a10); s11(self, a11); s12(self, a12); s13(self, a13); s14(self, a14)
    s15(self, a15); s16(self, a16); s17(self, a17); s18(self, a18); s19(self, a19); s20(self, a20); s21(self, a21)
    s22(self, a22); s23(self, a23); s24(self, a24); s25(self, a25); s26(self, a26); s27(self, a27); s28(self, a28)
    s29(self, a29); s30(self, a30); s31(self, a31); s32(self, a32)


INITIALS = (
    _1, _2, _3, _4, _5, _6, _7, _8, _9, _10, _11, _12, _13, _14, _15, _16, _17, _18, _19, _20, _21, _22, _23, _24,
    _25, _26, _27, _28, _29, _30, _31, _32, _33,
)
"""Of one field, of two, ..."""
