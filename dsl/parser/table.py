"""Tables of the parser, generated from `sd.lark` by `grammar.py`: do not edit.

Texts, not tuples, because a text costs nothing to compile; `automaton` decodes them.
"""

# ruff: noqa: E501

FINAL = 11
"""The state that has read a whole file."""

LOOKAHEADS = """\
<end>
<newline>
bundle
component
const
domain
fn
from
model
scene
table
unit
<end> <newline>
<name>
{
=
(
import
( <name> <newline> import on { }
.
of
base
}
branch
cocoord coord
content
discrete
dynamic
energy
every
expect
for
implicit
init
input
law
let
level
lossless
node
output
param
gamma phi psi
port
quasi
require
state
when
work
-
<number>
<quantity>
<text>
[
false
if
not
true
displacement effort flow momentum
ground
pseudo
)
:
: <end> <newline>
,
<newline> }
, : <newline> = }
<function>
always finally static
at
golden
) , <end> <newline> ] else restitution then while { }
or
) , <end> <newline> ] and else or restitution then while { }
!=
<
<=
==
>
>=
!= ) * + , - .. / : < <= <end> <newline> = == > >= ] and as else every in on or restitution then to while within { }
^
!= ) * + , - .. / : < <= <end> <newline> = == > >= ] ^ and as else every in on or restitution then to while within { }
) , <end> <newline> ] else or restitution then while { }
and
'
!= ) , .. : < <= <end> <newline> = == > >= ] and as else every in on or restitution then to while within { }
+
!= ) + , - .. : < <= <end> <newline> = == > >= ] and as else every in on or restitution then to while within { }
*
/
!= ' ) * + , - -> . .. / : < <= <end> <newline> = == > >= [ ] ^ and as else every in on or restitution then to while within { }
]
common
->
( . <name> <newline> import on { }
$
<end> <newline> }
' , . := <newline> = [ } ~
in
~
default
extends
on
( - <name> <number> <quantity> <text> [ false true
!= ' ) * + , - -> . .. / : := < <= <end> <newline> = == > >= [ ] ^ and as else every in on or restitution then to while within { } ~
then
accuracy
formulation
limit
redundancy
set
solver
time
trace
<newline> = intangible tangible } ~
) , <newline> = as cubic every hold intangible linear pchip tangible } ~
) , . / <newline> = as cubic every hold intangible linear pchip tangible } ~
, : <end> <newline>
, ]
..
within
) ,
!= ' ) * + , - . / < <= == > >= [ ^ and or
, <newline> }
' , -> . <newline> [ }
, :
intangible tangible
' , -> . := <newline> = [ } ~
:=
else
to
, <newline> every }
as
<newline> every }
cubic hold linear pchip
<name> <newline> on }
, : ] {
clamp extend stop
file
!= * + , - / < <= <newline> == > >= ^ and or }
restitution
while
<newline> restitution while }
<index>
"""
"""Sets of terminals, one a line."""

ROWS = """\
-1:0 15:1 16:2 17:3 18:4 19:5 20:6 21:7 22:8 23:9 24:10 25:11
-2:0
-3:12
-4:12
-5:12
-6:12
-7:12
-8:12
-9:0 27:1
-10:12
-11:12

-12:12
-13:12
-14:12
-15:0 16:2 17:3 18:4 19:5 20:6 21:7 22:8 23:9 24:10 25:11 29:1
30:13
31:13
32:13
33:13
34:13
36:13
37:13
38:13
39:13
40:13
-16:0 41:1
-17:0 16:2 17:3 18:4 19:5 20:6 21:7 22:8 23:9 24:10 25:11
-18:0 44:1
-19:0
45:14
47:14
48:15
49:14
50:16
51:17
-20:18 53:19
47:14
55:20
56:16
57:15 58:21
-21:0 16:2 17:3 18:4 19:5 20:6 21:7 22:8 23:9 24:10 25:11
-22:12
-23:0 60:1
-24:0 16:2 17:3 18:4 19:5 20:6 21:7 22:8 23:9 24:10 25:11
-25:22 64:13 65:1
-26:12
-27:22 97:13 98:1 99:23 100:24 101:25 102:26 103:27 104:28 105:29 106:30 107:31 108:32 109:33 110:34 111:35 112:36 113:37 114:38 115:39 116:40 117:41 118:42 119:43 120:44 121:45 122:46 123:47 124:48
137:16 138:49 139:13 140:50 141:51 142:52 143:53 144:54 145:55 146:56 147:57
-28:22 150:1 151:58 152:59 153:39 154:60
157:61 158:13
64:13
-29:18 160:19
161:13
-30:12
36:13
158:13
137:16 138:49 139:13 140:50 141:51 142:52 143:53 144:54 145:55 146:56 147:57
-31:12
-32:12
-33:0 16:2 17:3 18:4 19:5 20:6 21:7 22:8 23:9 24:10 25:11
165:22
-34:22 167:1
168:62
-35:63 170:64
-36:22 64:13 172:1
173:22
-37:65
-38:65
-39:65
-40:65
174:62
-41:65
-42:65
-43:65
-44:65
-45:65
-46:65
-47:65
-48:65
-49:65
-50:65
-51:65
-52:65
-53:65
-54:65
-55:65
-56:65
-57:65
-58:65
-59:65
-60:65
-61:65
-62:65
-63:22 176:1
-64:65
-65:65
-66:66 178:53
-67:22 97:13 99:23 100:24 101:25 102:26 103:27 104:28 105:29 106:30 107:31 108:32 109:33 110:34 111:35 112:36 113:37 114:38 115:39 116:40 117:41 118:42 119:43 120:44 121:45 122:46 123:47 124:48 180:1
97:13 183:62
97:13
185:67
97:13
188:13
189:67
137:16 138:49 139:13 140:50 141:51 142:52 143:53 144:54 147:57
137:16 138:49 139:13 140:50 141:51 142:52 143:53 144:54 147:57 193:68 194:69 195:70
196:13
97:13
188:13
97:13
137:16 138:49 139:13 140:50 141:51 142:52 143:53 144:54 147:57
97:13
202:13
-68:65
97:13
97:13
97:13
97:13
97:13
97:13
137:16 138:49 139:13 140:50 141:51 142:52 143:53 144:54 145:55 146:56 147:57
97:13
137:16 138:49 139:13 140:50 141:51 142:52 143:53 144:54 145:55 146:56 147:57
137:16 138:49 139:13 140:50 141:51 142:52 143:53 144:54 147:57
-69:71 214:72
-70:73 216:74 217:75 218:76 219:77 220:78 221:79
-71:80 222:81
-72:82
-73:73
-74:12
-75:83 224:84
-76:71
-77:80
-78:82 225:85 226:19 227:53
-79:86 229:87 230:49
-80:88 232:89 233:90
137:16 138:49 139:13 140:50 141:51 142:52 143:53 144:54 145:55 146:56 147:57
137:16 138:49 139:13 140:50 141:51 142:52 143:53 144:54 147:57
-81:91 236:16
-82:82
-83:82
-84:82
137:16 138:49 139:13 140:50 141:51 142:52 143:53 144:54 145:55 146:56 147:57 238:92
-85:82
137:16 138:49 139:13 140:50 141:51 142:52 143:53 144:54 145:55 146:56 147:57
137:16 138:49 139:13 140:50 141:51 142:52 143:53 144:54 146:56 147:57
-86:82
241:22
-87:22 243:1
-88:22 151:58 152:59 153:39 154:60 245:1
246:13
247:52
248:93
249:62
-89:61 251:64
252:61
253:94
254:62 255:53
-90:12
256:13
-91:95
257:14
258:61
-92:12
-93:12
-94:22 259:1
-95:22 64:13
264:96 265:13 266:50
-96:63 267:64
268:13
-97:22 270:1
-98:22
-99:97
36:13
-100:22 272:1
-101:22 97:13 99:23 100:24 101:25 102:26 103:27 104:28 105:29 106:30 107:31 108:32 109:33 110:34 111:35 112:36 113:37 114:38 115:39 116:40 117:41 118:42 119:43 120:44 121:45 122:46 123:47 124:48
-102:66
137:16 138:49 139:13 140:50 141:51 142:52 143:53 144:54 147:57
-103:22 279:1
-104:22
-105:62 281:64
282:62
264:96 265:13 266:50
284:62
285:13 286:15
287:62 288:15
225:85 227:53 289:19 290:15
-81:98
291:13 292:15
294:14
216:74 217:75 218:76 219:77 220:78 221:79
137:16 138:49 139:13 140:50 141:51 142:52 143:53 144:54 147:57
297:62
137:16 138:49 139:13 140:50 141:51 142:52 143:53 144:54 147:57
299:52
300:99
301:62
225:85 227:53 289:19 303:15 304:100
305:62
306:15
307:15
47:14 309:101 310:102
311:62
312:15
-106:65 313:62 314:15
315:62
316:62
317:62
-107:65
-108:65 318:62 319:15
294:14
321:103
-109:71 322:72
137:16 138:49 139:13 140:50 141:51 142:52 143:53 144:54 146:56 147:57
137:16 138:49 139:13 140:50 141:51 142:52 143:53 144:54 147:57
-110:104
-111:104
-112:104
-113:104
-114:104
-115:104
137:16 138:49 139:13 140:50 141:51 142:52 143:53 144:54 147:57
-116:83 326:84
137:16 138:49 139:13 140:50 141:51 142:52 143:53 144:54 146:56 147:57
-117:105
328:13
137:16 138:49 139:13 140:50 141:51 142:52 143:53 144:54 147:57
-118:86 330:87 331:49
137:16 138:49 139:13 140:50 141:51 142:52 143:53 144:54 147:57
137:16 138:49 139:13 140:50 141:51 142:52 143:53 144:54 147:57
-119:88 334:89 335:90
137:16 138:49 139:13 140:50 141:51 142:52 143:53 144:54 147:57
137:16 138:49 139:13 140:50 141:51 142:52 143:53 144:54 147:57
338:61
-120:80
137:16 138:49 140:50 141:51 142:52 143:53 144:54 145:55 146:56 147:57 342:61 343:13
345:64 346:92
-121:82
347:106
-122:73
-123:12
-124:22 348:1
-125:22 151:58 152:59 153:39 154:60
-126:22 351:1
-127:22
352:62
-128:65
353:58
264:96 265:13 266:50
-129:61 355:64
158:13
357:94
264:96 265:13 266:50
264:96 265:13 266:50
137:16 138:49 139:13 140:50 141:51 142:52 143:53 144:54 145:55 146:56 147:57
-130:95
-131:22 106:30 109:33 123:47 376:1 377:107 378:108 379:37 380:109 381:110 382:111 383:112 384:113 385:114
386:94
-132:22 64:13
-133:65
-134:65
-135:115
-136:116 389:19 390:90
391:13
-137:117 392:81
-138:117
393:13
-139:118
-140:22 394:1
-141:22 64:13
-142:65 399:16 400:13 401:103
-143:22 97:13 99:23 100:24 101:25 102:26 103:27 104:28 105:29 106:30 107:31 108:32 109:33 110:34 111:35 112:36 113:37 114:38 115:39 116:40 117:41 118:42 119:43 120:44 121:45 122:46 123:47 124:48
-144:65
-145:119 403:120
-146:92 405:64
406:92
-147:119
-148:22 407:1
-149:22 97:13 99:23 100:24 101:25 102:26 103:27 104:28 105:29 106:30 107:31 108:32 109:33 110:34 111:35 112:36 113:37 114:38 115:39 116:40 117:41 118:42 119:43 120:44 121:45 122:46 123:47 124:48
-150:62 408:64
97:13
264:96 265:13 266:50
-151:65
264:96 265:13 266:50
412:15
137:16 138:49 139:13 140:50 141:51 142:52 143:53 144:54 145:55 146:56 147:57
264:96 265:13 266:50
137:16 138:49 139:13 140:50 141:51 142:52 143:53 144:54 145:55 146:56 147:57
416:13
137:16 138:49 139:13 140:50 141:51 142:52 143:53 144:54 145:55 146:56 147:57
418:15
137:16 138:49 139:13 140:50 141:51 142:52 143:53 144:54 145:55 146:56 147:57
-152:65
-153:22 188:13 423:1
137:16 138:49 139:13 140:50 141:51 142:52 143:53 144:54 147:57
216:74 217:75 218:76 219:77 220:78 221:79
-154:104
426:62
427:121
137:16 138:49 139:13 140:50 141:51 142:52 143:53 144:54 147:57
264:96 265:13 266:50
-155:65
137:16 138:49 139:13 140:50 141:51 142:52 143:53 144:54 145:55 146:56 147:57
137:16 138:49 139:13 140:50 141:51 142:52 143:53 144:54 145:55 146:56 147:57
264:96 265:13 266:50
137:16 138:49 139:13 140:50 141:51 142:52 143:53 144:54 145:55 146:56 147:57
137:16 138:49 139:13 140:50 141:51 142:52 143:53 144:54 145:55 146:56 147:57
-156:65
47:14
437:13
264:96 265:13 266:50
137:16 138:49 139:13 140:50 141:51 142:52 143:53 144:54 145:55 146:56 147:57
264:96 265:13 266:50
137:16 138:49 139:13 140:50 141:51 142:52 143:53 144:54 145:55 146:56 147:57
137:16 138:49 139:13 140:50 141:51 142:52 143:53 144:54 147:57
264:96 265:13 266:50
264:96 265:13 266:50
264:96 265:13 266:50
137:16 138:49 139:13 140:50 141:51 142:52 143:53 144:54 145:55 146:56 147:57
-157:65
137:16 138:49 139:13 140:50 141:51 142:52 143:53 144:54 147:57
137:16 138:49 139:13 140:50 141:51 142:52 143:53 144:54 146:56 147:57
-158:83
-159:73
-160:80
137:16 138:49 139:13 140:50 141:51 142:52 143:53 144:54 146:56 147:57
-161:73
-162:91 450:16
451:92
137:16 138:49 139:13 140:50 141:51 142:52 143:53 144:54 147:57
137:16 138:49 139:13 140:50 141:51 142:52 143:53 144:54 147:57
-163:88
-164:88
137:16 138:49 139:13 140:50 141:51 142:52 143:53 144:54 147:57
137:16 138:49 139:13 140:50 141:51 142:52 143:53 144:54 147:57
-165:80
-166:80
-167:82
456:61
-168:61 458:64
-169:122
-170:82
-81:123 236:16 459:15 460:99
461:64 462:92
137:16 138:49 139:13 140:50 141:51 142:52 143:53 144:54 145:55 146:56 147:57
-171:82
137:16 138:49 139:13 140:50 141:51 142:52 143:53 144:54 145:55 146:56 147:57
-172:22 151:58 152:59 153:39 154:60
-173:65
-174:22 466:1
-175:22 151:58 152:59 153:39 154:60
264:96 265:13 266:50
-176:65
-177:65
158:13
-178:122
264:96 265:13 266:50
470:15
-179:122
471:92
472:22
-180:65
-181:65
-182:65
-183:65
-184:65
-185:65
-186:65
-187:65
-188:22 474:1
-189:65
-190:65
-191:65
-192:65
-193:65
-194:22 106:30 109:33 123:47 377:107 378:108 379:37 380:109 381:110 382:111 383:112 384:113 385:114 476:1
137:16 138:49 139:13 140:50 141:51 142:52 143:53 144:54 147:57
478:13
188:13
480:13
481:13
188:13
483:13
137:16 138:49 139:13 140:50 141:51 142:52 143:53 144:54 147:57
137:16 138:49 139:13 140:50 141:51 142:52 143:53 144:54 147:57
264:96 265:13 266:50
-195:65
-196:116 489:19 490:90
264:96 265:13 266:50
264:96 265:13 266:50
-197:117 493:81
496:49 497:50
-198:118
-199:22 64:13
-200:65 400:13 401:103
-201:65 500:64
-202:65
-203:124 225:85 227:53 289:19 501:94
137:16 138:49 140:50 141:51 142:52 143:53 144:54 145:55 146:56 147:57 503:61 504:13
-81:125 505:15
137:16 138:49 139:13 140:50 141:51 142:52 143:53 144:54 147:57 507:15
-204:65
137:16 138:49 139:13 140:50 141:51 142:52 143:53 144:54 147:57
-205:92 509:64
137:16 138:49 139:13 140:50 141:51 142:52 143:53 144:54 147:57
-206:66
-207:22 97:13 99:23 100:24 101:25 102:26 103:27 104:28 105:29 106:30 107:31 108:32 109:33 110:34 111:35 112:36 113:37 114:38 115:39 116:40 117:41 118:42 119:43 120:44 121:45 122:46 123:47 124:48
97:13
-208:126
-209:65
-210:65 303:15 304:100 513:127
137:16 138:49 139:13 140:50 141:51 142:52 143:53 144:54 145:55 146:56 147:57
-211:65
515:15
-212:65
-162:128
-213:65
137:16 138:49 139:13 140:50 141:51 142:52 143:53 144:54 145:55 146:56 147:57
-214:65
517:22
-215:22 519:1
225:85 227:53 289:19 520:129
-216:22 188:13 522:1
-217:65 523:121
137:16 138:49 139:13 140:50 141:51 142:52 143:53 144:54 147:57
-218:104
137:16 138:49 139:13 140:50 141:51 142:52 143:53 144:54 147:57
403:120
47:14
-219:65 303:15 304:100
-220:65
-221:65
-222:65 528:15
-223:65
-224:65
-225:65
47:14 530:101
-226:65 303:15 304:100
-227:65
-228:65 532:15
-229:65
534:76 535:15 536:79
-230:65
537:15
-231:65 538:15
-232:65
-233:65
-234:83
-235:73
137:16 138:49 140:50 141:51 142:52 143:53 144:54 145:55 146:56 147:57 504:13 540:61
-236:105
-237:88
-238:88
-239:80
-240:80
-241:82
-242:61 541:64
137:16 138:49 140:50 141:51 142:52 143:53 144:54 145:55 146:56 147:57 504:13
137:16 138:49 139:13 140:50 141:51 142:52 143:53 144:54 145:55 146:56 147:57
137:16 138:49 139:13 140:50 141:51 142:52 143:53 144:54 147:57
137:16 138:49 139:13 140:50 141:51 142:52 143:53 144:54 145:55 146:56 147:57
-243:82
-244:119
546:130
-245:65
-246:22 151:58 152:59 153:39 154:60
-247:65
-248:122
547:15
137:16 138:49 139:13 140:50 141:51 142:52 143:53 144:54 145:55 146:56 147:57
549:62
-249:12
-250:22 550:1
-251:22 106:30 109:33 123:47 377:107 378:108 379:37 380:109 381:110 382:111 383:112 384:113 385:114
-252:22 553:1
-253:22
-254:65 554:103
-255:65
225:85 227:53 289:19 555:15
137:16 138:49 139:13 140:50 141:51 142:52 143:53 144:54 147:57
-256:65
225:85 227:53 289:19 557:15
-257:65 559:16
560:131
-258:132 561:133 562:99
-259:134 564:64
-260:65 565:29
566:135
264:96 265:13 266:50
264:96 265:13 266:50
-261:117
-262:117
496:49 497:50
-263:117
-264:117
570:50
-265:117
-266:65
-267:65 571:64
400:13 401:103
188:13
574:61
-268:136
-81:123 236:16 459:15
137:16 138:49 139:13 140:50 141:51 142:52 143:53 144:54 145:55 146:56 147:57
-269:124
137:16 138:49 139:13 140:50 141:51 142:52 143:53 144:54 145:55 146:56 147:57
-270:137
137:16 138:49 139:13 140:50 141:51 142:52 143:53 144:54 147:57
-271:119
-272:126
-273:65
-274:65 303:15 304:100
-275:65
137:16 138:49 139:13 140:50 141:51 142:52 143:53 144:54 145:55 146:56 147:57
-276:65
-277:65
-278:22 581:1
-279:22 188:13
137:16 138:49 139:13 140:50 141:51 142:52 143:53 144:54 145:55 146:56 147:57
-280:22 585:1
-281:22
137:16 138:49 139:13 140:50 141:51 142:52 143:53 144:54 147:57
-282:65 587:121
-283:65
-284:65
-285:65
137:16 138:49 139:13 140:50 141:51 142:52 143:53 144:54 145:55 146:56 147:57
-286:65
47:14
-287:65
137:16 138:49 139:13 140:50 141:51 142:52 143:53 144:54 145:55 146:56 147:57
137:16 138:49 139:13 140:50 141:51 142:52 143:53 144:54 147:57
-288:104
-289:104
-290:104
137:16 138:49 139:13 140:50 141:51 142:52 143:53 144:54 145:55 146:56 147:57
137:16 138:49 139:13 140:50 141:51 142:52 143:53 144:54 145:55 146:56 147:57
594:61
-291:82
137:16 138:49 140:50 141:51 142:52 143:53 144:54 145:55 146:56 147:57 504:13
-292:122
-293:122
596:62
-294:119
137:16 138:49 139:13 140:50 141:51 142:52 143:53 144:54 145:55 146:56 147:57
137:16 138:49 139:13 140:50 141:51 142:52 143:53 144:54 145:55 146:56 147:57
-295:12
264:96 265:13 266:50
-296:22 106:30 109:33 123:47 377:107 378:108 379:37 380:109 381:110 382:111 383:112 384:113 385:114
-297:65
-298:22 601:1
-299:22 106:30 109:33 123:47 377:107 378:108 379:37 380:109 381:110 382:111 383:112 384:113 385:114
137:16 138:49 139:13 140:50 141:51 142:52 143:53 144:54 147:57
604:13
-300:65
137:16 138:49 139:13 140:50 141:51 142:52 143:53 144:54 145:55 146:56 147:57
-301:65
137:16 138:49 140:50 141:51 142:52 143:53 144:54 145:55 146:56 147:57 609:61 610:13
137:16 138:49 139:13 140:50 141:51 142:52 143:53 144:54 147:57
612:13
264:96 265:13 266:50
-302:134 614:64
137:16 138:49 139:13 140:50 141:51 142:52 143:53 144:54 147:57
137:16 138:49 139:13 140:50 141:51 142:52 143:53 144:54 147:57
618:53 619:138 620:139
-303:117
-304:117
-305:117
-306:117
400:13 401:103
-307:124
-308:124 225:85 227:53 289:19
-309:136
-310:124
-78:140 225:85 226:19 227:53 622:94
-311:124
-312:119
-313:65
-314:65
-315:22 188:13
-316:65
-317:65
-318:22 624:1
-319:22 188:13
-320:65
137:16 138:49 139:13 140:50 141:51 142:52 143:53 144:54 147:57
-321:65
-322:65
-323:65
-324:65 629:141 630:142
-325:65
-326:65
-327:82
-328:122
137:16 138:49 139:13 140:50 141:51 142:52 143:53 144:54 145:55 146:56 147:57
-329:71
-330:12
-331:122
-332:65
-333:22 106:30 109:33 123:47 377:107 378:108 379:37 380:109 381:110 382:111 383:112 384:113 385:114
-334:65 633:64
-335:65
-336:65
-337:65
634:61
-338:122
-339:61 636:64
-340:65
-81:123 236:16 637:15
-341:65
-342:132
-343:132 638:133
137:16 138:49 139:13 140:50 141:51 142:52 143:53 144:54 147:57
-344:132
-345:65
-346:12
641:16
618:53 643:139
644:52
-347:124
188:13
-348:65
-349:22 188:13
-350:65
-351:65 629:141 630:142
-352:143
-353:65
137:16 138:49 139:13 140:50 141:51 142:52 143:53 144:54 147:57
137:16 138:49 139:13 140:50 141:51 142:52 143:53 144:54 145:55 146:56 147:57
649:61
-354:65 650:64
137:16 138:49 139:13 140:50 141:51 142:52 143:53 144:54 147:57
-355:65
-356:61 652:64
137:16 138:49 140:50 141:51 142:52 143:53 144:54 145:55 146:56 147:57 610:13
137:16 138:49 139:13 140:50 141:51 142:52 143:53 144:54 145:55 146:56 147:57 655:144
656:13
-357:132
658:64 659:92
496:49 662:50
-358:12
663:52
-359:12
-360:124 225:85 227:53 289:19
-361:143
-362:143
-363:143
-364:82
137:16 138:49 139:13 140:50 141:51 142:52 143:53 144:54 147:57
-365:124
137:16 138:49 140:50 141:51 142:52 143:53 144:54 145:55 146:56 147:57 610:13
-366:122
-367:122
-368:122
-369:132
666:64 667:92
641:16 669:92
-370:12
671:64
-371:122
-372:122
-373:12
-374:124
-375:122
641:16 673:92
-376:12
-377:119
-378:12
674:61 675:64
496:49 662:50
-379:119
-380:12
-381:119
496:49 662:50
-382:122
-383:122
"""
"""For each state action:set, where the action is a state to shift to, or -1 - rule to reduce."""

GOTOS = """\
_body{item}:1 bundle:2 component:3 const:4 domain:5 function:6 import_:7 item:8 model:9 scene:10 start:11 table:12 unit_alias:13 unit_base:14







___body{item}_star_19:26






bundle:2 component:3 const:4 domain:5 function:6 import_:7 item:28 model:9 scene:10 table:12 unit_alias:13 unit_base:14





dotted:35





bundle:2 component:3 const:4 domain:5 function:6 import_:7 item:42 model:9 scene:10 table:12 unit_alias:13 unit_base:14
___body{item}_star_19:43


block:46




__dotted_star_0:52
block:54



bundle:2 component:3 const:4 domain:5 function:6 import_:7 item:59 model:9 scene:10 table:12 unit_alias:13 unit_base:14


bundle:2 component:3 const:4 domain:5 function:6 import_:7 item:42 model:9 scene:10 table:12 unit_alias:13 unit_base:14
_body{bundle_member}:61 bundle_member:62 words:63

_body{statement}:66 branch:67 constraint:68 content:69 coord:70 decl:71 discrete:72 dynamic:73 energy:74 every:75 expect:76 for_:77 golden:78 implicit:79 init:80 input:81 instance:82 law:83 let:84 level:85 lossless:86 node:87 output:88 param:89 port:90 quasi:91 require:92 state:93 statement:94 when:95 work:96
and_:125 arith:126 atom:127 call:128 compare:129 expr:130 not_:131 or_:132 power:133 ref:134 term:135 unary:136
_body{role}:148 role:149
parameter:155 parameters:156
words:159



dotted:162
parameter:155 parameters:163
and_:125 arith:126 atom:127 call:128 compare:129 expr:164 not_:131 or_:132 power:133 ref:134 term:135 unary:136


bundle:2 component:3 const:4 domain:5 function:6 import_:7 item:59 model:9 scene:10 table:12 unit_alias:13 unit_base:14

___body{bundle_member}_star_21:166

__words_star_1:169
bundle_member:171 words:63




























___body{statement}_star_23:175


_indices:177
branch:67 constraint:68 content:69 coord:70 decl:71 discrete:72 dynamic:73 energy:74 every:75 expect:76 for_:77 golden:78 implicit:79 init:80 input:81 instance:82 law:83 let:84 level:85 lossless:86 node:87 output:88 param:89 port:90 quasi:91 require:92 state:93 statement:179 when:95 work:96
decl:181 decls:182
decl:181 decls:184

decl:186
ref:187

arith:190 atom:127 call:128 power:133 ref:134 term:135 unary:136
arith:191 atom:127 call:128 moment:192 power:133 ref:134 term:135 unary:136

decl:181 decls:197
ref:198
decl:199
arith:200 atom:127 call:128 power:133 ref:134 term:135 unary:136
decl:201


decl:181 decls:203
decl:204
decl:205
decl:206
decl:181 decls:207
decl:208
and_:125 arith:126 atom:127 call:128 compare:129 expr:209 not_:131 or_:132 power:133 ref:134 term:135 unary:136
decl:210
and_:125 arith:126 atom:127 call:128 compare:129 expr:211 not_:131 or_:132 power:133 ref:134 term:135 unary:136
arith:212 atom:127 call:128 power:133 ref:134 term:135 unary:136
__or__star_14:213
comparison:215




__and__star_15:223



__arith_star_16:228
__term_star_17:231
and_:125 arith:126 atom:127 call:128 compare:129 expr:234 not_:131 or_:132 power:133 ref:134 term:135 unary:136
atom:127 call:128 power:133 ref:134 unary:235




and_:125 arith:126 atom:127 call:128 compare:129 expr:237 not_:131 or_:132 power:133 ref:134 term:135 unary:136

and_:125 arith:126 atom:127 call:128 compare:129 expr:239 not_:131 or_:132 power:133 ref:134 term:135 unary:136
arith:126 atom:127 call:128 compare:129 not_:240 power:133 ref:134 term:135 unary:136


___body{role}_star_20:242
role:244




__parameters_star_2:250











bundle_member:260 words:63
domain_name:261 unit:262 unit_factor:263


___body{bundle_member}_star_21:269


dotted:271

branch:67 constraint:68 content:69 coord:70 decl:71 discrete:72 dynamic:73 energy:74 every:75 expect:76 for_:77 golden:78 implicit:79 init:80 input:81 instance:82 law:83 let:84 level:85 lossless:86 node:87 output:88 param:89 port:90 quasi:91 require:92 state:93 statement:273 when:95 work:96

arith:274 atom:127 call:128 index:275 indices:276 power:133 range:277 ref:134 term:135 unary:136
___body{statement}_star_23:278

__decls_star_8:280

domain_name:283 unit:262 unit_factor:263






actions:293
comparison:295
arith:296 atom:127 call:128 power:133 ref:134 term:135 unary:136

arith:298 atom:127 call:128 power:133 ref:134 term:135 unary:136



initial:302



block:308








actions:320


and_:323 arith:126 atom:127 call:128 compare:129 not_:131 power:133 ref:134 term:135 unary:136
arith:324 atom:127 call:128 power:133 ref:134 term:135 unary:136






atom:127 call:128 power:133 ref:134 unary:325

arith:126 atom:127 call:128 compare:129 not_:327 power:133 ref:134 term:135 unary:136


arith:274 atom:127 call:128 index:275 indices:329 power:133 range:277 ref:134 term:135 unary:136

atom:127 call:128 power:133 ref:134 term:332 unary:136
atom:127 call:128 power:133 ref:134 term:333 unary:136

atom:127 call:128 power:133 ref:134 unary:336
atom:127 call:128 power:133 ref:134 unary:337


_args:339 and_:125 arg:340 arith:126 atom:127 call:128 compare:129 expr:341 not_:131 or_:132 power:133 ref:134 term:135 unary:136
__atom_star_18:344





role:349
___body{role}_star_20:350




unit:354 unit_factor:263

parameter:356

unit:358 unit_factor:263
unit:359 unit_factor:263
and_:125 arith:126 atom:127 call:128 compare:129 expr:360 not_:131 or_:132 power:133 ref:134 term:135 unary:136

_body{scene_statement}:361 accuracy:362 expect:363 formulation:364 golden:365 init:366 limit:367 redundancy:368 scene_level:369 scene_statement:370 set_:371 solver:372 time:373 trace:374 when:375

bundle_member:387 words:63



__unit_star_13:388






bundle_member:260 words:63
args:395 connection:396 connections:397 ref:398
branch:67 constraint:68 content:69 coord:70 decl:71 discrete:72 dynamic:73 energy:74 every:75 expect:76 for_:77 golden:78 implicit:79 init:80 input:81 instance:82 law:83 let:84 level:85 lossless:86 node:87 output:88 param:89 port:90 quasi:91 require:92 state:93 statement:402 when:95 work:96


__indices_star_9:404



branch:67 constraint:68 content:69 coord:70 decl:71 discrete:72 dynamic:73 energy:74 every:75 expect:76 for_:77 golden:78 implicit:79 init:80 input:81 instance:82 law:83 let:84 level:85 lossless:86 node:87 output:88 param:89 port:90 quasi:91 require:92 state:93 statement:273 when:95 work:96

decl:409
domain_name:410 unit:262 unit_factor:263

domain_name:411 unit:262 unit_factor:263

and_:125 arith:126 atom:127 call:128 compare:129 expr:413 not_:131 or_:132 power:133 ref:134 term:135 unary:136
unit:414 unit_factor:263
and_:125 arith:126 atom:127 call:128 compare:129 expr:415 not_:131 or_:132 power:133 ref:134 term:135 unary:136

and_:125 arith:126 atom:127 call:128 compare:129 expr:417 not_:131 or_:132 power:133 ref:134 term:135 unary:136

and_:125 arith:126 atom:127 call:128 compare:129 expr:419 not_:131 or_:132 power:133 ref:134 term:135 unary:136

_body{action}:420 action:421 ref:422
arith:424 atom:127 call:128 power:133 ref:134 term:135 unary:136
comparison:425



arith:428 atom:127 call:128 power:133 range:429 ref:134 term:135 unary:136
unit:430 unit_factor:263

and_:125 arith:126 atom:127 call:128 compare:129 expr:431 not_:131 or_:132 power:133 ref:134 term:135 unary:136
and_:125 arith:126 atom:127 call:128 compare:129 expr:432 not_:131 or_:132 power:133 ref:134 term:135 unary:136
unit:433 unit_factor:263
and_:125 arith:126 atom:127 call:128 compare:129 expr:434 not_:131 or_:132 power:133 ref:134 term:135 unary:136
and_:125 arith:126 atom:127 call:128 compare:129 expr:435 not_:131 or_:132 power:133 ref:134 term:135 unary:136

block:436

domain_name:438 unit:262 unit_factor:263
and_:125 arith:126 atom:127 call:128 compare:129 expr:439 not_:131 or_:132 power:133 ref:134 term:135 unary:136
unit:440 unit_factor:263
and_:125 arith:126 atom:127 call:128 compare:129 expr:441 not_:131 or_:132 power:133 ref:134 term:135 unary:136
arith:442 atom:127 call:128 power:133 ref:134 term:135 unary:136
domain_name:443 unit:262 unit_factor:263
unit:444 unit_factor:263
unit:445 unit_factor:263
and_:125 arith:126 atom:127 call:128 compare:129 expr:446 not_:131 or_:132 power:133 ref:134 term:135 unary:136

arith:447 atom:127 call:128 power:133 ref:134 term:135 unary:136
and_:448 arith:126 atom:127 call:128 compare:129 not_:131 power:133 ref:134 term:135 unary:136



arith:126 atom:127 call:128 compare:129 not_:449 power:133 ref:134 term:135 unary:136



atom:127 call:128 power:133 ref:134 term:452 unary:136
atom:127 call:128 power:133 ref:134 term:453 unary:136


atom:127 call:128 power:133 ref:134 unary:454
atom:127 call:128 power:133 ref:134 unary:455




___args_star_7:457




and_:125 arith:126 atom:127 call:128 compare:129 expr:463 not_:131 or_:132 power:133 ref:134 term:135 unary:136

and_:125 arith:126 atom:127 call:128 compare:129 expr:464 not_:131 or_:132 power:133 ref:134 term:135 unary:136
role:465


role:349
unit:467 unit_factor:263


parameter:468

unit:469 unit_factor:263












___body{scene_statement}_star_22:473





accuracy:362 expect:363 formulation:364 golden:365 init:366 limit:367 redundancy:368 scene_level:369 scene_statement:475 set_:371 solver:372 time:373 trace:374 when:375
arith:477 atom:127 call:128 power:133 ref:134 term:135 unary:136

ref:479


ref:482

arith:484 atom:127 call:128 power:133 ref:134 term:135 unary:136
arith:485 atom:127 call:128 power:133 ref:134 term:135 trace_item:486 trace_items:487 unary:136
unit:488 unit_factor:263


unit_factor:491
unit_factor:492

_exponent:494 negative_number:495

bundle_member:387 words:63
connection:396 connections:498 ref:398
__connections_star_6:499


_args:502 and_:125 arg:340 arith:126 atom:127 call:128 compare:129 expr:341 not_:131 or_:132 power:133 ref:134 term:135 unary:136

arith:506 atom:127 call:128 power:133 ref:134 term:135 unary:136

arith:508 atom:127 call:128 power:133 ref:134 term:135 unary:136

arith:274 atom:127 call:128 index:510 power:133 range:277 ref:134 term:135 unary:136

branch:67 constraint:68 content:69 coord:70 decl:71 discrete:72 dynamic:73 energy:74 every:75 expect:76 for_:77 golden:78 implicit:79 init:80 input:81 instance:82 law:83 let:84 level:85 lossless:86 node:87 output:88 param:89 port:90 quasi:91 require:92 state:93 statement:402 when:95 work:96
decl:511


initial:512
and_:125 arith:126 atom:127 call:128 compare:129 expr:514 not_:131 or_:132 power:133 ref:134 term:135 unary:136





and_:125 arith:126 atom:127 call:128 compare:129 expr:516 not_:131 or_:132 power:133 ref:134 term:135 unary:136


___body{action}_star_24:518

action:521 ref:422

arith:524 atom:127 call:128 power:133 ref:134 term:135 unary:136

arith:525 atom:127 call:128 power:133 ref:134 term:135 unary:136

block:526
initial:527






block:529
initial:531



relation:533







_args:539 and_:125 arg:340 arith:126 atom:127 call:128 compare:129 expr:341 not_:131 or_:132 power:133 ref:134 term:135 unary:136







and_:125 arg:542 arith:126 atom:127 call:128 compare:129 expr:341 not_:131 or_:132 power:133 ref:134 term:135 unary:136
and_:125 arith:126 atom:127 call:128 compare:129 expr:543 not_:131 or_:132 power:133 ref:134 term:135 unary:136
arith:428 atom:127 call:128 power:133 range:544 ref:134 term:135 unary:136
and_:125 arith:126 atom:127 call:128 compare:129 expr:545 not_:131 or_:132 power:133 ref:134 term:135 unary:136




role:465



and_:125 arith:126 atom:127 call:128 compare:129 expr:548 not_:131 or_:132 power:133 ref:134 term:135 unary:136



accuracy:362 expect:363 formulation:364 golden:365 init:366 limit:367 redundancy:368 scene_level:369 scene_statement:551 set_:371 solver:372 time:373 trace:374 when:375
___body{scene_statement}_star_22:552




arith:556 atom:127 call:128 power:133 ref:134 term:135 unary:136


options:558


__trace_items_star_10:563


unit_factor:567
unit_factor:568


_exponent:569 negative_number:495






connection:572 ref:398
ref:573



and_:125 arith:126 atom:127 call:128 compare:129 expr:575 not_:131 or_:132 power:133 ref:576 term:135 unary:136

and_:125 arith:126 atom:127 call:128 compare:129 expr:577 not_:131 or_:132 power:133 ref:134 term:135 unary:136

arith:274 atom:127 call:128 index:578 power:133 range:277 ref:134 term:135 unary:136



initial:579

and_:125 arith:126 atom:127 call:128 compare:129 expr:580 not_:131 or_:132 power:133 ref:134 term:135 unary:136



action:582 ref:422
and_:125 arith:126 atom:127 call:128 compare:129 expr:583 not_:131 or_:132 power:133 ref:134 term:135 unary:136
___body{action}_star_24:584

arith:586 atom:127 call:128 power:133 ref:134 term:135 unary:136




and_:125 arith:126 atom:127 call:128 compare:129 expr:588 not_:131 or_:132 power:133 ref:134 term:135 unary:136

block:589

and_:125 arith:126 atom:127 call:128 compare:129 expr:590 not_:131 or_:132 power:133 ref:134 term:135 unary:136
arith:591 atom:127 call:128 power:133 ref:134 term:135 unary:136



and_:125 arith:126 atom:127 call:128 compare:129 expr:592 not_:131 or_:132 power:133 ref:134 term:135 unary:136
and_:125 arith:126 atom:127 call:128 compare:129 expr:593 not_:131 or_:132 power:133 ref:134 term:135 unary:136


and_:125 arg:595 arith:126 atom:127 call:128 compare:129 expr:341 not_:131 or_:132 power:133 ref:134 term:135 unary:136




and_:125 arith:126 atom:127 call:128 compare:129 expr:597 not_:131 or_:132 power:133 ref:134 term:135 unary:136
and_:125 arith:126 atom:127 call:128 compare:129 expr:598 not_:131 or_:132 power:133 ref:134 term:135 unary:136

unit:599 unit_factor:263
accuracy:362 expect:363 formulation:364 golden:365 init:366 limit:367 redundancy:368 scene_level:369 scene_statement:600 set_:371 solver:372 time:373 trace:374 when:375


accuracy:362 expect:363 formulation:364 golden:365 init:366 limit:367 redundancy:368 scene_level:369 scene_statement:551 set_:371 solver:372 time:373 trace:374 when:375
arith:602 ariths:603 atom:127 call:128 power:133 ref:134 term:135 unary:136


and_:125 arith:126 atom:127 call:128 compare:129 expr:605 not_:131 or_:132 power:133 ref:134 term:135 unary:136

_options:606 and_:125 arith:126 atom:127 call:128 compare:129 expr:607 not_:131 option:608 or_:132 power:133 ref:134 term:135 unary:136
arith:611 atom:127 call:128 power:133 ref:134 term:135 unary:136

unit:613 unit_factor:263

arith:485 atom:127 call:128 power:133 ref:134 term:135 trace_item:615 unary:136
arith:616 atom:127 call:128 power:133 ref:134 term:135 unary:136
rows:617




connection:621 ref:398









action:623 ref:422



action:582 ref:422

arith:625 atom:127 call:128 power:133 ref:134 term:135 unary:136



__guards_star_5:626 guard:627 guards:628




and_:125 arith:126 atom:127 call:128 compare:129 expr:631 not_:131 or_:132 power:133 ref:134 term:135 unary:136




accuracy:362 expect:363 formulation:364 golden:365 init:366 limit:367 redundancy:368 scene_level:369 scene_statement:600 set_:371 solver:372 time:373 trace:374 when:375
__ariths_star_11:632





___options_star_12:635





arith:485 atom:127 call:128 power:133 ref:134 term:135 trace_item:639 unary:136



row:640
rows:642


ref:645

action:623 ref:422

guard:646


arith:647 atom:127 call:128 power:133 ref:134 term:135 unary:136
and_:125 arith:126 atom:127 call:128 compare:129 expr:648 not_:131 or_:132 power:133 ref:134 term:135 unary:136


arith:651 atom:127 call:128 power:133 ref:134 term:135 unary:136


and_:125 arith:126 atom:127 call:128 compare:129 expr:607 not_:131 option:653 or_:132 power:133 ref:134 term:135 unary:136
and_:125 arith:126 atom:127 call:128 compare:129 expr:654 not_:131 or_:132 power:133 ref:134 term:135 unary:136


__rows_star_3:657
_signed:660 negative_number:661








arith:664 atom:127 call:128 power:133 ref:134 term:135 unary:136

and_:125 arith:126 atom:127 call:128 compare:129 expr:607 not_:131 option:665 or_:132 power:133 ref:134 term:135 unary:136





row:668

__row_plus_4:670





row:672




_signed:676 negative_number:661



_signed:677 negative_number:661


"""
"""For each state left side:state."""

RULES = """\
_body{item} 0 []
start 1 start 0*
item 1 = 0
item 1 = 0
item 1 = 0
item 1 = 0
item 1 = 0
item 1 = 0
_body{item} 1 [] 0
item 1 = 0
item 1 = 0
item 1 = 0
item 1 = 0
item 1 = 0
_body{item} 1 []
_body{item} 2 [] 0 1*
_body{item} 2 [] 0
_body{item} 2 [] 1
_body{item} 2 []
dotted 1 dotted 0
_body{item} 3 [] 0 1*
___body{item}_star_19 2 [] 1
_body{item} 3 [] 1 2*
_body{item} 3 [] 1
_body{bundle_member} 0 []
component 3 component 1 2
_body{statement} 0 []
_body{role} 0 []
dotted 2 dotted 0 1*
model 3 model 1 2
unit_base 3 unit_base 1
___body{item}_star_19 3 [] 0* 2
_body{item} 4 [] 1 2*
_body{bundle_member} 1 [] 0
words 1 words 0
_body{bundle_member} 1 []
statement 1 = 0
statement 1 = 0
statement 1 = 0
statement 1 = 0
statement 1 = 0
statement 1 = 0
statement 1 = 0
statement 1 = 0
statement 1 = 0
statement 1 = 0
statement 1 = 0
statement 1 = 0
statement 1 = 0
statement 1 = 0
statement 1 = 0
statement 1 = 0
statement 1 = 0
statement 1 = 0
statement 1 = 0
statement 1 = 0
statement 1 = 0
statement 1 = 0
statement 1 = 0
statement 1 = 0
statement 1 = 0
statement 1 = 0
_body{statement} 1 [] 0
statement 1 = 0
statement 1 = 0
decl 1 decl 0
_body{statement} 1 []
lossless 1 lossless
or_ 1 = 0
compare 1 = 0
power 1 = 0
atom 1 = 0
not_ 1 = 0
const 4 const 1 3
and_ 1 = 0
expr 1 = 0
unary 1 = 0
atom 1 = 0
arith 1 = 0
term 1 = 0
ref 1 name 0
atom 1 = 0
atom 1 = 0
atom 1 = 0
atom 1 false
atom 1 true
_body{role} 1 [] 0
_body{role} 1 []
parameters 1 parameters 0
import_ 4 import_ 1 3
__dotted_star_0 2 [] 1
unit_alias 4 unit_alias 1 3
bundle 5 bundle 1 3*
_body{bundle_member} 2 [] 0 1*
_body{bundle_member} 2 [] 0
words 2 words 0 1*
_body{bundle_member} 2 [] 1
_body{bundle_member} 2 []
block 3 block 1*
_body{statement} 2 [] 0 1*
_body{statement} 2 [] 0
decl 2 decl 0 1*
_body{statement} 2 [] 1
_body{statement} 2 []
decls 1 decls 0
param 2 param 1 - -
require 2 require 1
state 2 state 1 - -
or_ 2 or_ 0 1*
comparison 1 comparison 0
comparison 1 comparison 0
comparison 1 comparison 0
comparison 1 comparison 0
comparison 1 comparison 0
comparison 1 comparison 0
and_ 2 and_ 0 1*
ref 2 prime 0
arith 2 arith 0 1*
term 2 term 0 1*
unary 2 negative 1
atom 2 array -
not_ 2 negation 1
domain 5 domain 1 3*
_body{role} 2 [] 0 1*
_body{role} 2 [] 0
_body{role} 2 [] 1
_body{role} 2 []
role 2 domain_ground 1
parameters 2 parameters 0 1*
__dotted_star_0 3 [] 0* 2
_body{scene_statement} 0 []
_body{bundle_member} 3 [] 0 1*
___body{bundle_member}_star_21 2 [] 1
bundle_member 3 bundle_member 0 2
domain_name 1 domain_name 0
unit 1 unit 0
unit_factor 1 unit_factor 0
unit_factor 1 unit_one 0
__words_star_1 2 [] 1
_body{bundle_member} 3 [] 1 2*
_body{bundle_member} 3 [] 1
instance 3 instance 0 2 - -
_body{statement} 3 [] 0 1*
___body{statement}_star_23 2 [] 1
index 1 = 0
indices 1 indices 0
index 1 = 0
_body{statement} 3 [] 1 2*
_body{statement} 3 [] 1
decls 2 decls 0 1*
branch 3 branch - 2
every 3 every 1 2
_body{action} 0 []
moment 2 moment 0
init 3 init 1 2
level 3 level 1 - - 2
when 3 when 1 2
__or__star_14 2 [] 1
compare 3 compare 0 1 2
power 3 power 0 2
__and__star_15 2 [] 1
ref 3 member 0 2
__arith_star_16 2 [] 0 1
__arith_star_16 2 [] 0 1
__term_star_17 2 [] 0 1
__term_star_17 2 [] 0 1
atom 3 group 1
_args 1 [] 0
arg 1 arg 0
call 3 call 0
atom 3 array 1
_body{role} 3 [] 0 1*
___body{role}_star_20 2 [] 1
_body{role} 3 [] 1 2*
_body{role} 3 [] 1
role 3 domain_node 2
role 3 domain_pseudo 2
__parameters_star_2 2 [] 1
parameter 3 parameter 0 - 2
scene_statement 1 = 0
scene_statement 1 = 0
scene_statement 1 = 0
scene_statement 1 = 0
scene_statement 1 = 0
scene_statement 1 = 0
scene_statement 1 = 0
scene_statement 1 = 0
_body{scene_statement} 1 [] 0
scene_statement 1 = 0
scene_statement 1 = 0
scene_statement 1 = 0
scene_statement 1 = 0
scene_statement 1 = 0
_body{scene_statement} 1 []
___body{bundle_member}_star_21 3 [] 0* 2
unit 2 unit 0 1*
unit_factor 2 unit_variable 1
__words_star_1 3 [] 0* 2
_body{bundle_member} 4 [] 1 2*
instance 4 instance 0 2 3 -
connections 1 connections 0
instance 4 instance 0 2 - 3
connection 1 single 0
___body{statement}_star_23 3 [] 0* 2
indices 2 indices 0 1*
_indices 3 [] 1
_body{statement} 4 [] 1 2*
__decls_star_8 2 [] 1
branch 4 branch 1 3
coord 4 coord 0 1 3 - -
content 4 content 1 - 3
discrete 4 discrete 1 - 3
dynamic 4 dynamic 1 3
energy 4 energy 1 - 3
_body{action} 1 [] 0
_body{action} 1 []
expect 4 expect - 1 2 3 -
moment 3 moment_at 1
implicit 4 implicit 1 3 -
initial 2 fixed 1
initial 2 guess 1
input 4 input 1 3 -
law 4 law 1 3
let 4 let 1 3
level 4 level 1 - 2 3
node 4 node 1 3 -
output 4 output 1 3
param 4 param 1 3 -
param 4 param 1 - 3
port 4 port 1 3
state 4 state 1 3 -
state 4 state 1 - 3
work 4 work 1 3
__or__star_14 3 [] 0* 2
__and__star_15 3 [] 0* 2
ref 4 item_of 0 2
__arith_star_16 3 [] 0* 1 2
__arith_star_16 3 [] 0* 1 2
__term_star_17 3 [] 0* 1 2
__term_star_17 3 [] 0* 1 2
call 4 call 0 2*
_args 2 [] 0 1*
atom 4 array 1 2*
__atom_star_18 2 [] 1
___body{role}_star_20 3 [] 0* 2
_body{role} 4 [] 1 2*
role 4 role 0 1 3
__parameters_star_2 3 [] 0* 2
scene 7 scene 1 3 5*
_body{scene_statement} 2 [] 0 1*
_body{scene_statement} 2 [] 0
_body{scene_statement} 2 [] 1
_body{scene_statement} 2 []
accuracy 2 accuracy 1 -
formulation 2 formulation 1
redundancy 2 redundancy 1
solver 2 solver 1 -
trace_item 1 trace_item 0 - -
trace_items 1 trace_items 0
trace 2 trace 1 -
__unit_star_13 2 [] 0 1
__unit_star_13 2 [] 0 1
unit_factor 3 unit_factor 0 2*
_exponent 1 [] 0
_exponent 1 [] 0
instance 5 instance 0 2 3 4
connections 2 connections 0 1*
args 2 args
connection 2 on 1
range 3 range 0 2
__indices_star_9 2 [] 1
__decls_star_8 3 [] 0* 2
coord 5 coord 0 1 3 - 4
coord 5 coord 0 1 3 4 -
content 5 content 1 2 4
energy 5 energy 1 2 4
actions 3 actions 1*
_body{action} 2 [] 0 1*
_body{action} 2 [] 0
_body{action} 2 [] 1
_body{action} 2 []
expect 5 expect 1 2 3 4 -
golden 5 golden 2 4
for_ 5 for_ 1 3 4
implicit 5 implicit 1 3 4
level 5 level 1 3 - 4
node 5 node 1 3 4
relation 1 relation 0
relation 1 relation 0
relation 1 relation 0
atom 5 method 0 2
___args_star_7 2 [] 1
arg 3 named_arg 0 2
__atom_star_18 3 [] 0* 2
function 8 function 1 - 5 7
_body{scene_statement} 3 [] 0 1*
___body{scene_statement}_star_22 2 [] 1
_body{scene_statement} 3 [] 1 2*
_body{scene_statement} 3 [] 1
limit 3 limit 1 2
solver 3 solver 1 2
trace_items 2 trace_items 0 1*
__unit_star_13 3 [] 0* 1 2
__unit_star_13 3 [] 0* 1 2
unit_factor 4 unit_variable 1 3*
negative_number 2 negative_number 1
__connections_star_6 2 [] 1
connection 3 across 0 2
args 3 args 1*
connection 3 bind 0 2
connection 3 bind_on 2
__indices_star_9 3 [] 0* 2
coord 6 coord 0 1 3 4 5
discrete 6 discrete 1 3 5
_body{action} 3 [] 0 1*
___body{action}_star_24 2 [] 1
action 3 action 0 2
_body{action} 3 [] 1 2*
_body{action} 3 [] 1
expect 6 expect - 1 2 3 5
input 6 input 1 3 5
level 6 level 1 3 4 5
param 6 param 1 3 5
guards 0 guards
quasi 6 quasi 1 3 5
state 6 state 1 3 5
atom 6 method 0 2 4*
___args_star_7 3 [] 0* 2
expr 6 conditional 1 3 5
function 9 function 1 3 6 8
parameter 6 parameter 0 2 5
___body{scene_statement}_star_22 3 [] 0* 2
_body{scene_statement} 4 [] 1 2*
ariths 1 ariths 0
accuracy 4 accuracy 1 3
scene_level 4 scene_level 1 3
set_ 4 set_ 1 3
option 1 arg 0
_options 1 [] 0
options 2 args
time 4 time 1 3
trace_item 3 trace_item 0 - 2
trace_item 3 trace_item 0 2 -
__trace_items_star_10 2 [] 1
trace 4 trace 1 3
table 9 table 1 3 6 7 - 8
__connections_star_6 3 [] 0* 2
___body{action}_star_24 3 [] 0* 2
_body{action} 4 [] 1 2*
expect 7 expect 1 2 3 4 6
guards 1 guards 0*
__guards_star_5 1 [] 0
constraint 7 constraint 0 1 3 4 5 6
ariths 2 ariths 0 1*
options 3 args 1*
_options 2 [] 0 1*
__trace_items_star_10 3 [] 0* 2
table 10 table 1 3 6 7 8 9
table 10 table_file 1 3 6 7 - 9
connection 5 bind_across 0 2 4
__guards_star_5 2 [] 0* 1
guard 2 guard_restitution 1
guard 2 guard_while 1
call 8 reduction 0 2 4 6
__ariths_star_11 2 [] 1
___options_star_12 2 [] 1
option 3 named_arg 0 2
option 3 index_form 0 2
trace_item 5 trace_item 0 2 4
rows 3 rows 1
_signed 1 [] 0
_signed 1 [] 0
table 11 table_file 1 3 6 7 8 10
__ariths_star_11 3 [] 0* 2
___options_star_12 3 [] 0* 2
rows 4 rows 1 2*
__rows_star_3 2 [] 1
rows 4 rows 1
__rows_star_3 3 [] 0* 2
rows 5 rows 1 2*
row 4 row 1* 2*
__row_plus_4 2 [] 1*
__row_plus_4 3 [] 0* 2*
"""
"""Left side, length, function, children: see `grammar._rule`."""
