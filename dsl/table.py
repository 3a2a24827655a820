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
-27:22 96:13 97:1 98:23 99:24 100:25 101:26 102:27 103:28 104:29 105:30 106:31 107:32 108:33 109:34 110:35 111:36 112:37 113:38 114:39 115:40 116:41 117:42 118:43 119:44 120:45 121:46 122:47
135:16 136:48 137:13 138:49 139:50 140:51 141:52 142:53 143:54 144:55 145:56
-28:22 148:1 149:57 150:58 151:39 152:59
155:60 156:13
64:13
-29:18 158:19
159:13
-30:12
36:13
156:13
135:16 136:48 137:13 138:49 139:50 140:51 141:52 142:53 143:54 144:55 145:56
-31:12
-32:12
-33:0 16:2 17:3 18:4 19:5 20:6 21:7 22:8 23:9 24:10 25:11
163:22
-34:22 165:1
166:61
-35:62 168:63
-36:22 64:13 170:1
171:22
-37:64
-38:64
-39:64
-40:64
172:61
-41:64
-42:64
-43:64
-44:64
-45:64
-46:64
-47:64
-48:64
-49:64
-50:64
-51:64
-52:64
-53:64
-54:64
-55:64
-56:64
-57:64
-58:64
-59:64
-60:64
-61:64
-62:22 174:1
-63:64
-64:64
-65:65 176:52
-66:22 96:13 98:23 99:24 100:25 101:26 102:27 103:28 104:29 105:30 106:31 107:32 108:33 109:34 110:35 111:36 112:37 113:38 114:39 115:40 116:41 117:42 118:43 119:44 120:45 121:46 122:47 178:1
96:13 181:61
96:13
183:66
96:13
186:13
187:66
135:16 136:48 137:13 138:49 139:50 140:51 141:52 142:53 145:56
135:16 136:48 137:13 138:49 139:50 140:51 141:52 142:53 145:56 191:67 192:68 193:69
194:13
96:13
186:13
96:13
135:16 136:48 137:13 138:49 139:50 140:51 141:52 142:53 145:56
96:13
200:13
-67:64
96:13
96:13
96:13
96:13
96:13
135:16 136:48 137:13 138:49 139:50 140:51 141:52 142:53 143:54 144:55 145:56
96:13
135:16 136:48 137:13 138:49 139:50 140:51 141:52 142:53 143:54 144:55 145:56
135:16 136:48 137:13 138:49 139:50 140:51 141:52 142:53 145:56
-68:70 211:71
-69:72 213:73 214:74 215:75 216:76 217:77 218:78
-70:79 219:80
-71:81
-72:72
-73:12
-74:82 221:83
-75:70
-76:79
-77:81 222:84 223:19 224:52
-78:85 226:86 227:48
-79:87 229:88 230:89
135:16 136:48 137:13 138:49 139:50 140:51 141:52 142:53 143:54 144:55 145:56
135:16 136:48 137:13 138:49 139:50 140:51 141:52 142:53 145:56
-80:90 233:16
-81:81
-82:81
-83:81
135:16 136:48 137:13 138:49 139:50 140:51 141:52 142:53 143:54 144:55 145:56 235:91
-84:81
135:16 136:48 137:13 138:49 139:50 140:51 141:52 142:53 143:54 144:55 145:56
135:16 136:48 137:13 138:49 139:50 140:51 141:52 142:53 144:55 145:56
-85:81
238:22
-86:22 240:1
-87:22 149:57 150:58 151:39 152:59 242:1
243:13
244:51
245:92
246:61
-88:60 248:63
249:60
250:93
251:61 252:52
-89:12
253:13
-90:94
254:14
255:60
-91:12
-92:12
-93:22 256:1
-94:22 64:13
261:95 262:13 263:49
-95:62 264:63
265:13
-96:22 267:1
-97:22
-98:96
36:13
-99:22 269:1
-100:22 96:13 98:23 99:24 100:25 101:26 102:27 103:28 104:29 105:30 106:31 107:32 108:33 109:34 110:35 111:36 112:37 113:38 114:39 115:40 116:41 117:42 118:43 119:44 120:45 121:46 122:47
-101:65
135:16 136:48 137:13 138:49 139:50 140:51 141:52 142:53 145:56
-102:22 276:1
-103:22
-104:61 278:63
279:61
261:95 262:13 263:49
281:61
282:13 283:15
284:61 285:15
222:84 224:52 286:19 287:15
-80:97
288:13 289:15
291:14
213:73 214:74 215:75 216:76 217:77 218:78
135:16 136:48 137:13 138:49 139:50 140:51 141:52 142:53 145:56
294:61
135:16 136:48 137:13 138:49 139:50 140:51 141:52 142:53 145:56
296:51
297:98
298:61
222:84 224:52 286:19 300:15 301:99
302:61
303:15
304:15
47:14 306:100 307:101
308:61
309:15
-105:64 310:61 311:15
312:61
313:61
-106:64
-107:64 314:61 315:15
291:14
317:102
-108:70 318:71
135:16 136:48 137:13 138:49 139:50 140:51 141:52 142:53 144:55 145:56
135:16 136:48 137:13 138:49 139:50 140:51 141:52 142:53 145:56
-109:103
-110:103
-111:103
-112:103
-113:103
-114:103
135:16 136:48 137:13 138:49 139:50 140:51 141:52 142:53 145:56
-115:82 322:83
135:16 136:48 137:13 138:49 139:50 140:51 141:52 142:53 144:55 145:56
-116:104
324:13
135:16 136:48 137:13 138:49 139:50 140:51 141:52 142:53 145:56
-117:85 326:86 327:48
135:16 136:48 137:13 138:49 139:50 140:51 141:52 142:53 145:56
135:16 136:48 137:13 138:49 139:50 140:51 141:52 142:53 145:56
-118:87 330:88 331:89
135:16 136:48 137:13 138:49 139:50 140:51 141:52 142:53 145:56
135:16 136:48 137:13 138:49 139:50 140:51 141:52 142:53 145:56
334:60
-119:79
135:16 136:48 138:49 139:50 140:51 141:52 142:53 143:54 144:55 145:56 338:60 339:13
341:63 342:91
-120:81
343:105
-121:72
-122:12
-123:22 344:1
-124:22 149:57 150:58 151:39 152:59
-125:22 347:1
-126:22
348:61
-127:64
349:57
261:95 262:13 263:49
-128:60 351:63
156:13
353:93
261:95 262:13 263:49
261:95 262:13 263:49
135:16 136:48 137:13 138:49 139:50 140:51 141:52 142:53 143:54 144:55 145:56
-129:94
-130:22 105:30 108:33 121:46 372:1 373:106 374:107 375:37 376:108 377:109 378:110 379:111 380:112 381:113
382:93
-131:22 64:13
-132:64
-133:64
-134:114
-135:115 385:19 386:89
387:13
-136:116 388:80
-137:116
389:13
-138:117
-139:22 390:1
-140:22 64:13
-141:64 395:16 396:13 397:102
-142:22 96:13 98:23 99:24 100:25 101:26 102:27 103:28 104:29 105:30 106:31 107:32 108:33 109:34 110:35 111:36 112:37 113:38 114:39 115:40 116:41 117:42 118:43 119:44 120:45 121:46 122:47
-143:64
-144:118 399:119
-145:91 401:63
402:91
-146:118
-147:22 403:1
-148:22 96:13 98:23 99:24 100:25 101:26 102:27 103:28 104:29 105:30 106:31 107:32 108:33 109:34 110:35 111:36 112:37 113:38 114:39 115:40 116:41 117:42 118:43 119:44 120:45 121:46 122:47
-149:61 404:63
96:13
261:95 262:13 263:49
-150:64
261:95 262:13 263:49
408:15
135:16 136:48 137:13 138:49 139:50 140:51 141:52 142:53 143:54 144:55 145:56
261:95 262:13 263:49
135:16 136:48 137:13 138:49 139:50 140:51 141:52 142:53 143:54 144:55 145:56
412:13
135:16 136:48 137:13 138:49 139:50 140:51 141:52 142:53 143:54 144:55 145:56
414:15
135:16 136:48 137:13 138:49 139:50 140:51 141:52 142:53 143:54 144:55 145:56
-151:64
-152:22 186:13 419:1
135:16 136:48 137:13 138:49 139:50 140:51 141:52 142:53 145:56
213:73 214:74 215:75 216:76 217:77 218:78
-153:103
422:61
423:120
135:16 136:48 137:13 138:49 139:50 140:51 141:52 142:53 145:56
261:95 262:13 263:49
-154:64
135:16 136:48 137:13 138:49 139:50 140:51 141:52 142:53 143:54 144:55 145:56
135:16 136:48 137:13 138:49 139:50 140:51 141:52 142:53 143:54 144:55 145:56
261:95 262:13 263:49
135:16 136:48 137:13 138:49 139:50 140:51 141:52 142:53 143:54 144:55 145:56
135:16 136:48 137:13 138:49 139:50 140:51 141:52 142:53 143:54 144:55 145:56
-155:64
47:14
433:13
261:95 262:13 263:49
135:16 136:48 137:13 138:49 139:50 140:51 141:52 142:53 143:54 144:55 145:56
261:95 262:13 263:49
135:16 136:48 137:13 138:49 139:50 140:51 141:52 142:53 143:54 144:55 145:56
135:16 136:48 137:13 138:49 139:50 140:51 141:52 142:53 145:56
261:95 262:13 263:49
261:95 262:13 263:49
135:16 136:48 137:13 138:49 139:50 140:51 141:52 142:53 143:54 144:55 145:56
-156:64
135:16 136:48 137:13 138:49 139:50 140:51 141:52 142:53 145:56
135:16 136:48 137:13 138:49 139:50 140:51 141:52 142:53 144:55 145:56
-157:82
-158:72
-159:79
135:16 136:48 137:13 138:49 139:50 140:51 141:52 142:53 144:55 145:56
-160:72
-161:90 445:16
446:91
135:16 136:48 137:13 138:49 139:50 140:51 141:52 142:53 145:56
135:16 136:48 137:13 138:49 139:50 140:51 141:52 142:53 145:56
-162:87
-163:87
135:16 136:48 137:13 138:49 139:50 140:51 141:52 142:53 145:56
135:16 136:48 137:13 138:49 139:50 140:51 141:52 142:53 145:56
-164:79
-165:79
-166:81
451:60
-167:60 453:63
-168:121
-169:81
-80:122 233:16 454:15 455:98
456:63 457:91
135:16 136:48 137:13 138:49 139:50 140:51 141:52 142:53 143:54 144:55 145:56
-170:81
135:16 136:48 137:13 138:49 139:50 140:51 141:52 142:53 143:54 144:55 145:56
-171:22 149:57 150:58 151:39 152:59
-172:64
-173:22 461:1
-174:22 149:57 150:58 151:39 152:59
261:95 262:13 263:49
-175:64
-176:64
156:13
-177:121
261:95 262:13 263:49
465:15
-178:121
466:91
467:22
-179:64
-180:64
-181:64
-182:64
-183:64
-184:64
-185:64
-186:64
-187:22 469:1
-188:64
-189:64
-190:64
-191:64
-192:64
-193:22 105:30 108:33 121:46 373:106 374:107 375:37 376:108 377:109 378:110 379:111 380:112 381:113 471:1
135:16 136:48 137:13 138:49 139:50 140:51 141:52 142:53 145:56
473:13
186:13
475:13
476:13
186:13
478:13
135:16 136:48 137:13 138:49 139:50 140:51 141:52 142:53 145:56
135:16 136:48 137:13 138:49 139:50 140:51 141:52 142:53 145:56
261:95 262:13 263:49
-194:64
-195:115 484:19 485:89
261:95 262:13 263:49
261:95 262:13 263:49
-196:116 488:80
491:48 492:49
-197:117
-198:22 64:13
-199:64 396:13 397:102
-200:64 495:63
-201:64
-202:123 222:84 224:52 286:19 496:93
135:16 136:48 138:49 139:50 140:51 141:52 142:53 143:54 144:55 145:56 498:60 499:13
-80:124 500:15
135:16 136:48 137:13 138:49 139:50 140:51 141:52 142:53 145:56
-203:64
135:16 136:48 137:13 138:49 139:50 140:51 141:52 142:53 145:56
-204:91 503:63
135:16 136:48 137:13 138:49 139:50 140:51 141:52 142:53 145:56
-205:65
-206:22 96:13 98:23 99:24 100:25 101:26 102:27 103:28 104:29 105:30 106:31 107:32 108:33 109:34 110:35 111:36 112:37 113:38 114:39 115:40 116:41 117:42 118:43 119:44 120:45 121:46 122:47
96:13
-207:125
-208:64
-209:64 300:15 301:99 507:126
135:16 136:48 137:13 138:49 139:50 140:51 141:52 142:53 143:54 144:55 145:56
-210:64
509:15
-211:64
-161:127
-212:64
135:16 136:48 137:13 138:49 139:50 140:51 141:52 142:53 143:54 144:55 145:56
-213:64
511:22
-214:22 513:1
222:84 224:52 286:19 514:128
-215:22 186:13 516:1
-216:64 517:120
135:16 136:48 137:13 138:49 139:50 140:51 141:52 142:53 145:56
-217:103
135:16 136:48 137:13 138:49 139:50 140:51 141:52 142:53 145:56
399:119
47:14
-218:64 300:15 301:99
-219:64
-220:64
-221:64 522:15
-222:64
-223:64
-224:64
47:14 524:100
-225:64 300:15 301:99
-226:64
-227:64 526:15
-228:64
528:75 529:15 530:78
-229:64
-230:64 531:15
-231:64
-232:64
-233:82
-234:72
135:16 136:48 138:49 139:50 140:51 141:52 142:53 143:54 144:55 145:56 499:13 533:60
-235:104
-236:87
-237:87
-238:79
-239:79
-240:81
-241:60 534:63
135:16 136:48 138:49 139:50 140:51 141:52 142:53 143:54 144:55 145:56 499:13
135:16 136:48 137:13 138:49 139:50 140:51 141:52 142:53 143:54 144:55 145:56
135:16 136:48 137:13 138:49 139:50 140:51 141:52 142:53 145:56
135:16 136:48 137:13 138:49 139:50 140:51 141:52 142:53 143:54 144:55 145:56
-242:81
-243:118
539:129
-244:64
-245:22 149:57 150:58 151:39 152:59
-246:64
-247:121
540:15
135:16 136:48 137:13 138:49 139:50 140:51 141:52 142:53 143:54 144:55 145:56
542:61
-248:12
-249:22 543:1
-250:22 105:30 108:33 121:46 373:106 374:107 375:37 376:108 377:109 378:110 379:111 380:112 381:113
-251:22 546:1
-252:22
-253:64 547:102
-254:64
222:84 224:52 286:19 548:15
135:16 136:48 137:13 138:49 139:50 140:51 141:52 142:53 145:56
-255:64
222:84 224:52 286:19 550:15
-256:64 395:16
552:130
-257:131 553:132 554:98
-258:133 556:63
-259:64 557:29
558:134
261:95 262:13 263:49
261:95 262:13 263:49
-260:116
-261:116
491:48 492:49
-262:116
-263:116
562:49
-264:116
-265:64
-266:64 563:63
396:13 397:102
186:13
566:60
-267:135
-80:122 233:16 454:15
135:16 136:48 137:13 138:49 139:50 140:51 141:52 142:53 143:54 144:55 145:56
-268:123
-269:136
135:16 136:48 137:13 138:49 139:50 140:51 141:52 142:53 145:56
-270:118
-271:125
-272:64
-273:64 300:15 301:99
-274:64
135:16 136:48 137:13 138:49 139:50 140:51 141:52 142:53 143:54 144:55 145:56
-275:64
-276:64
-277:22 572:1
-278:22 186:13
135:16 136:48 137:13 138:49 139:50 140:51 141:52 142:53 143:54 144:55 145:56
-279:22 576:1
-280:22
135:16 136:48 137:13 138:49 139:50 140:51 141:52 142:53 145:56
-281:64 578:120
-282:64
-283:64
-284:64
135:16 136:48 137:13 138:49 139:50 140:51 141:52 142:53 143:54 144:55 145:56
-285:64
47:14
-286:64
135:16 136:48 137:13 138:49 139:50 140:51 141:52 142:53 143:54 144:55 145:56
135:16 136:48 137:13 138:49 139:50 140:51 141:52 142:53 145:56
-287:103
-288:103
-289:103
135:16 136:48 137:13 138:49 139:50 140:51 141:52 142:53 143:54 144:55 145:56
584:60
-290:81
135:16 136:48 138:49 139:50 140:51 141:52 142:53 143:54 144:55 145:56 499:13
-291:121
-292:121
586:61
-293:118
135:16 136:48 137:13 138:49 139:50 140:51 141:52 142:53 143:54 144:55 145:56
135:16 136:48 137:13 138:49 139:50 140:51 141:52 142:53 143:54 144:55 145:56
-294:12
261:95 262:13 263:49
-295:22 105:30 108:33 121:46 373:106 374:107 375:37 376:108 377:109 378:110 379:111 380:112 381:113
-296:64
-297:22 591:1
-298:22 105:30 108:33 121:46 373:106 374:107 375:37 376:108 377:109 378:110 379:111 380:112 381:113
135:16 136:48 137:13 138:49 139:50 140:51 141:52 142:53 145:56
594:13
-299:64
135:16 136:48 137:13 138:49 139:50 140:51 141:52 142:53 143:54 144:55 145:56
-300:64
135:16 136:48 137:13 138:49 139:50 140:51 141:52 142:53 145:56
597:13
261:95 262:13 263:49
-301:133 599:63
135:16 136:48 137:13 138:49 139:50 140:51 141:52 142:53 145:56
135:16 136:48 137:13 138:49 139:50 140:51 141:52 142:53 145:56
603:52 604:137 605:138
-302:116
-303:116
-304:116
-305:116
396:13 397:102
-306:123
-307:123 222:84 224:52 286:19
-308:135
-309:123
-77:139 222:84 223:19 224:52 607:93
-310:118
-311:64
-312:64
-313:22 186:13
-314:64
-315:64
-316:22 609:1
-317:22 186:13
-318:64
135:16 136:48 137:13 138:49 139:50 140:51 141:52 142:53 145:56
-319:64
-320:64
-321:64
-322:64 614:140 615:141
-323:64
-324:81
-325:121
135:16 136:48 137:13 138:49 139:50 140:51 141:52 142:53 143:54 144:55 145:56
-326:70
-327:12
-328:121
-329:64
-330:22 105:30 108:33 121:46 373:106 374:107 375:37 376:108 377:109 378:110 379:111 380:112 381:113
-331:64 618:63
-332:64
-333:64
-334:64
-335:64
-336:131
-337:131 619:132
135:16 136:48 137:13 138:49 139:50 140:51 141:52 142:53 145:56
-338:131
-339:64
-340:12
622:16
603:52 624:138
625:51
-341:123
186:13
-342:64
-343:22 186:13
-344:64
-345:64 614:140 615:141
-346:142
-347:64
135:16 136:48 137:13 138:49 139:50 140:51 141:52 142:53 145:56
135:16 136:48 137:13 138:49 139:50 140:51 141:52 142:53 143:54 144:55 145:56
630:60
-348:64 631:63
135:16 136:48 137:13 138:49 139:50 140:51 141:52 142:53 145:56
633:13
-349:131
635:63 636:91
491:48 639:49
-350:12
640:51
-351:12
-352:123 222:84 224:52 286:19
-353:142
-354:142
-355:142
-356:81
135:16 136:48 137:13 138:49 139:50 140:51 141:52 142:53 145:56
-357:123
-358:131
642:63 643:91
622:16 645:91
-359:12
647:63
-360:121
-361:121
-362:12
-363:123
622:16 649:91
-364:12
-365:118
-366:12
650:60 651:63
491:48 639:49
-367:118
-368:12
-369:118
491:48 639:49
-370:121
-371:121
"""
"""For each state action:set, where the action is a state to shift to, or -1 - rule to reduce."""

GOTOS = """\
_body{item}:1 bundle:2 component:3 const:4 domain:5 function:6 import_:7 item:8 model:9 scene:10 start:11 table:12 unit_alias:13 unit_base:14







___body{item}_star_18:26






bundle:2 component:3 const:4 domain:5 function:6 import_:7 item:28 model:9 scene:10 table:12 unit_alias:13 unit_base:14





dotted:35





bundle:2 component:3 const:4 domain:5 function:6 import_:7 item:42 model:9 scene:10 table:12 unit_alias:13 unit_base:14
___body{item}_star_18:43


block:46




__dotted_star_0:52
block:54



bundle:2 component:3 const:4 domain:5 function:6 import_:7 item:59 model:9 scene:10 table:12 unit_alias:13 unit_base:14


bundle:2 component:3 const:4 domain:5 function:6 import_:7 item:42 model:9 scene:10 table:12 unit_alias:13 unit_base:14
_body{bundle_member}:61 bundle_member:62 words:63

_body{statement}:66 branch:67 constraint:68 content:69 coord:70 decl:71 discrete:72 dynamic:73 energy:74 every:75 expect:76 for_:77 golden:78 implicit:79 init:80 input:81 instance:82 law:83 let:84 level:85 lossless:86 node:87 output:88 param:89 port:90 require:91 state:92 statement:93 when:94 work:95
and_:123 arith:124 atom:125 call:126 compare:127 expr:128 not_:129 or_:130 power:131 ref:132 term:133 unary:134
_body{role}:146 role:147
parameter:153 parameters:154
words:157



dotted:160
parameter:153 parameters:161
and_:123 arith:124 atom:125 call:126 compare:127 expr:162 not_:129 or_:130 power:131 ref:132 term:133 unary:134


bundle:2 component:3 const:4 domain:5 function:6 import_:7 item:59 model:9 scene:10 table:12 unit_alias:13 unit_base:14

___body{bundle_member}_star_20:164

__words_star_1:167
bundle_member:169 words:63



























___body{statement}_star_22:173


_indices:175
branch:67 constraint:68 content:69 coord:70 decl:71 discrete:72 dynamic:73 energy:74 every:75 expect:76 for_:77 golden:78 implicit:79 init:80 input:81 instance:82 law:83 let:84 level:85 lossless:86 node:87 output:88 param:89 port:90 require:91 state:92 statement:177 when:94 work:95
decl:179 decls:180
decl:179 decls:182

decl:184
ref:185

arith:188 atom:125 call:126 power:131 ref:132 term:133 unary:134
arith:189 atom:125 call:126 moment:190 power:131 ref:132 term:133 unary:134

decl:179 decls:195
ref:196
decl:197
arith:198 atom:125 call:126 power:131 ref:132 term:133 unary:134
decl:199


decl:179 decls:201
decl:202
decl:203
decl:204
decl:179 decls:205
and_:123 arith:124 atom:125 call:126 compare:127 expr:206 not_:129 or_:130 power:131 ref:132 term:133 unary:134
decl:207
and_:123 arith:124 atom:125 call:126 compare:127 expr:208 not_:129 or_:130 power:131 ref:132 term:133 unary:134
arith:209 atom:125 call:126 power:131 ref:132 term:133 unary:134
__or__star_13:210
comparison:212




__and__star_14:220



__arith_star_15:225
__term_star_16:228
and_:123 arith:124 atom:125 call:126 compare:127 expr:231 not_:129 or_:130 power:131 ref:132 term:133 unary:134
atom:125 call:126 power:131 ref:132 unary:232




and_:123 arith:124 atom:125 call:126 compare:127 expr:234 not_:129 or_:130 power:131 ref:132 term:133 unary:134

and_:123 arith:124 atom:125 call:126 compare:127 expr:236 not_:129 or_:130 power:131 ref:132 term:133 unary:134
arith:124 atom:125 call:126 compare:127 not_:237 power:131 ref:132 term:133 unary:134


___body{role}_star_19:239
role:241




__parameters_star_2:247











bundle_member:257 words:63
domain_name:258 unit:259 unit_factor:260


___body{bundle_member}_star_20:266


dotted:268

branch:67 constraint:68 content:69 coord:70 decl:71 discrete:72 dynamic:73 energy:74 every:75 expect:76 for_:77 golden:78 implicit:79 init:80 input:81 instance:82 law:83 let:84 level:85 lossless:86 node:87 output:88 param:89 port:90 require:91 state:92 statement:270 when:94 work:95

arith:271 atom:125 call:126 index:272 indices:273 power:131 range:274 ref:132 term:133 unary:134
___body{statement}_star_22:275

__decls_star_8:277

domain_name:280 unit:259 unit_factor:260






actions:290
comparison:292
arith:293 atom:125 call:126 power:131 ref:132 term:133 unary:134

arith:295 atom:125 call:126 power:131 ref:132 term:133 unary:134



initial:299



block:305







actions:316


and_:319 arith:124 atom:125 call:126 compare:127 not_:129 power:131 ref:132 term:133 unary:134
arith:320 atom:125 call:126 power:131 ref:132 term:133 unary:134






atom:125 call:126 power:131 ref:132 unary:321

arith:124 atom:125 call:126 compare:127 not_:323 power:131 ref:132 term:133 unary:134


arith:271 atom:125 call:126 index:272 indices:325 power:131 range:274 ref:132 term:133 unary:134

atom:125 call:126 power:131 ref:132 term:328 unary:134
atom:125 call:126 power:131 ref:132 term:329 unary:134

atom:125 call:126 power:131 ref:132 unary:332
atom:125 call:126 power:131 ref:132 unary:333


_args:335 and_:123 arg:336 arith:124 atom:125 call:126 compare:127 expr:337 not_:129 or_:130 power:131 ref:132 term:133 unary:134
__atom_star_17:340





role:345
___body{role}_star_19:346




unit:350 unit_factor:260

parameter:352

unit:354 unit_factor:260
unit:355 unit_factor:260
and_:123 arith:124 atom:125 call:126 compare:127 expr:356 not_:129 or_:130 power:131 ref:132 term:133 unary:134

_body{scene_statement}:357 accuracy:358 expect:359 formulation:360 golden:361 init:362 limit:363 redundancy:364 scene_level:365 scene_statement:366 set_:367 solver:368 time:369 trace:370 when:371

bundle_member:383 words:63



__unit_star_12:384






bundle_member:257 words:63
args:391 connection:392 connections:393 ref:394
branch:67 constraint:68 content:69 coord:70 decl:71 discrete:72 dynamic:73 energy:74 every:75 expect:76 for_:77 golden:78 implicit:79 init:80 input:81 instance:82 law:83 let:84 level:85 lossless:86 node:87 output:88 param:89 port:90 require:91 state:92 statement:398 when:94 work:95


__indices_star_9:400



branch:67 constraint:68 content:69 coord:70 decl:71 discrete:72 dynamic:73 energy:74 every:75 expect:76 for_:77 golden:78 implicit:79 init:80 input:81 instance:82 law:83 let:84 level:85 lossless:86 node:87 output:88 param:89 port:90 require:91 state:92 statement:270 when:94 work:95

decl:405
domain_name:406 unit:259 unit_factor:260

domain_name:407 unit:259 unit_factor:260

and_:123 arith:124 atom:125 call:126 compare:127 expr:409 not_:129 or_:130 power:131 ref:132 term:133 unary:134
unit:410 unit_factor:260
and_:123 arith:124 atom:125 call:126 compare:127 expr:411 not_:129 or_:130 power:131 ref:132 term:133 unary:134

and_:123 arith:124 atom:125 call:126 compare:127 expr:413 not_:129 or_:130 power:131 ref:132 term:133 unary:134

and_:123 arith:124 atom:125 call:126 compare:127 expr:415 not_:129 or_:130 power:131 ref:132 term:133 unary:134

_body{action}:416 action:417 ref:418
arith:420 atom:125 call:126 power:131 ref:132 term:133 unary:134
comparison:421



arith:424 atom:125 call:126 power:131 range:425 ref:132 term:133 unary:134
unit:426 unit_factor:260

and_:123 arith:124 atom:125 call:126 compare:127 expr:427 not_:129 or_:130 power:131 ref:132 term:133 unary:134
and_:123 arith:124 atom:125 call:126 compare:127 expr:428 not_:129 or_:130 power:131 ref:132 term:133 unary:134
unit:429 unit_factor:260
and_:123 arith:124 atom:125 call:126 compare:127 expr:430 not_:129 or_:130 power:131 ref:132 term:133 unary:134
and_:123 arith:124 atom:125 call:126 compare:127 expr:431 not_:129 or_:130 power:131 ref:132 term:133 unary:134

block:432

domain_name:434 unit:259 unit_factor:260
and_:123 arith:124 atom:125 call:126 compare:127 expr:435 not_:129 or_:130 power:131 ref:132 term:133 unary:134
unit:436 unit_factor:260
and_:123 arith:124 atom:125 call:126 compare:127 expr:437 not_:129 or_:130 power:131 ref:132 term:133 unary:134
arith:438 atom:125 call:126 power:131 ref:132 term:133 unary:134
domain_name:439 unit:259 unit_factor:260
unit:440 unit_factor:260
and_:123 arith:124 atom:125 call:126 compare:127 expr:441 not_:129 or_:130 power:131 ref:132 term:133 unary:134

arith:442 atom:125 call:126 power:131 ref:132 term:133 unary:134
and_:443 arith:124 atom:125 call:126 compare:127 not_:129 power:131 ref:132 term:133 unary:134



arith:124 atom:125 call:126 compare:127 not_:444 power:131 ref:132 term:133 unary:134



atom:125 call:126 power:131 ref:132 term:447 unary:134
atom:125 call:126 power:131 ref:132 term:448 unary:134


atom:125 call:126 power:131 ref:132 unary:449
atom:125 call:126 power:131 ref:132 unary:450




___args_star_7:452




and_:123 arith:124 atom:125 call:126 compare:127 expr:458 not_:129 or_:130 power:131 ref:132 term:133 unary:134

and_:123 arith:124 atom:125 call:126 compare:127 expr:459 not_:129 or_:130 power:131 ref:132 term:133 unary:134
role:460


role:345
unit:462 unit_factor:260


parameter:463

unit:464 unit_factor:260












___body{scene_statement}_star_21:468





accuracy:358 expect:359 formulation:360 golden:361 init:362 limit:363 redundancy:364 scene_level:365 scene_statement:470 set_:367 solver:368 time:369 trace:370 when:371
arith:472 atom:125 call:126 power:131 ref:132 term:133 unary:134

ref:474


ref:477

arith:479 atom:125 call:126 power:131 ref:132 term:133 unary:134
arith:480 atom:125 call:126 power:131 ref:132 term:133 trace_item:481 trace_items:482 unary:134
unit:483 unit_factor:260


unit_factor:486
unit_factor:487

_exponent:489 negative_number:490

bundle_member:383 words:63
connection:392 connections:493 ref:394
__connections_star_6:494


_args:497 and_:123 arg:336 arith:124 atom:125 call:126 compare:127 expr:337 not_:129 or_:130 power:131 ref:132 term:133 unary:134

arith:501 atom:125 call:126 power:131 ref:132 term:133 unary:134

arith:502 atom:125 call:126 power:131 ref:132 term:133 unary:134

arith:271 atom:125 call:126 index:504 power:131 range:274 ref:132 term:133 unary:134

branch:67 constraint:68 content:69 coord:70 decl:71 discrete:72 dynamic:73 energy:74 every:75 expect:76 for_:77 golden:78 implicit:79 init:80 input:81 instance:82 law:83 let:84 level:85 lossless:86 node:87 output:88 param:89 port:90 require:91 state:92 statement:398 when:94 work:95
decl:505


initial:506
and_:123 arith:124 atom:125 call:126 compare:127 expr:508 not_:129 or_:130 power:131 ref:132 term:133 unary:134





and_:123 arith:124 atom:125 call:126 compare:127 expr:510 not_:129 or_:130 power:131 ref:132 term:133 unary:134


___body{action}_star_23:512

action:515 ref:418

arith:518 atom:125 call:126 power:131 ref:132 term:133 unary:134

arith:519 atom:125 call:126 power:131 ref:132 term:133 unary:134

block:520
initial:521






block:523
initial:525



relation:527






_args:532 and_:123 arg:336 arith:124 atom:125 call:126 compare:127 expr:337 not_:129 or_:130 power:131 ref:132 term:133 unary:134







and_:123 arg:535 arith:124 atom:125 call:126 compare:127 expr:337 not_:129 or_:130 power:131 ref:132 term:133 unary:134
and_:123 arith:124 atom:125 call:126 compare:127 expr:536 not_:129 or_:130 power:131 ref:132 term:133 unary:134
arith:424 atom:125 call:126 power:131 range:537 ref:132 term:133 unary:134
and_:123 arith:124 atom:125 call:126 compare:127 expr:538 not_:129 or_:130 power:131 ref:132 term:133 unary:134




role:460



and_:123 arith:124 atom:125 call:126 compare:127 expr:541 not_:129 or_:130 power:131 ref:132 term:133 unary:134



accuracy:358 expect:359 formulation:360 golden:361 init:362 limit:363 redundancy:364 scene_level:365 scene_statement:544 set_:367 solver:368 time:369 trace:370 when:371
___body{scene_statement}_star_21:545




arith:549 atom:125 call:126 power:131 ref:132 term:133 unary:134


args:551


__trace_items_star_10:555


unit_factor:559
unit_factor:560


_exponent:561 negative_number:490






connection:564 ref:394
ref:565



and_:123 arith:124 atom:125 call:126 compare:127 expr:567 not_:129 or_:130 power:131 ref:568 term:133 unary:134


arith:271 atom:125 call:126 index:569 power:131 range:274 ref:132 term:133 unary:134



initial:570

and_:123 arith:124 atom:125 call:126 compare:127 expr:571 not_:129 or_:130 power:131 ref:132 term:133 unary:134



action:573 ref:418
and_:123 arith:124 atom:125 call:126 compare:127 expr:574 not_:129 or_:130 power:131 ref:132 term:133 unary:134
___body{action}_star_23:575

arith:577 atom:125 call:126 power:131 ref:132 term:133 unary:134




and_:123 arith:124 atom:125 call:126 compare:127 expr:579 not_:129 or_:130 power:131 ref:132 term:133 unary:134

block:580

and_:123 arith:124 atom:125 call:126 compare:127 expr:581 not_:129 or_:130 power:131 ref:132 term:133 unary:134
arith:582 atom:125 call:126 power:131 ref:132 term:133 unary:134



and_:123 arith:124 atom:125 call:126 compare:127 expr:583 not_:129 or_:130 power:131 ref:132 term:133 unary:134


and_:123 arg:585 arith:124 atom:125 call:126 compare:127 expr:337 not_:129 or_:130 power:131 ref:132 term:133 unary:134




and_:123 arith:124 atom:125 call:126 compare:127 expr:587 not_:129 or_:130 power:131 ref:132 term:133 unary:134
and_:123 arith:124 atom:125 call:126 compare:127 expr:588 not_:129 or_:130 power:131 ref:132 term:133 unary:134

unit:589 unit_factor:260
accuracy:358 expect:359 formulation:360 golden:361 init:362 limit:363 redundancy:364 scene_level:365 scene_statement:590 set_:367 solver:368 time:369 trace:370 when:371


accuracy:358 expect:359 formulation:360 golden:361 init:362 limit:363 redundancy:364 scene_level:365 scene_statement:544 set_:367 solver:368 time:369 trace:370 when:371
arith:592 ariths:593 atom:125 call:126 power:131 ref:132 term:133 unary:134


and_:123 arith:124 atom:125 call:126 compare:127 expr:595 not_:129 or_:130 power:131 ref:132 term:133 unary:134

arith:596 atom:125 call:126 power:131 ref:132 term:133 unary:134

unit:598 unit_factor:260

arith:480 atom:125 call:126 power:131 ref:132 term:133 trace_item:600 unary:134
arith:601 atom:125 call:126 power:131 ref:132 term:133 unary:134
rows:602




connection:606 ref:394








action:608 ref:418



action:573 ref:418

arith:610 atom:125 call:126 power:131 ref:132 term:133 unary:134



__guards_star_5:611 guard:612 guards:613



and_:123 arith:124 atom:125 call:126 compare:127 expr:616 not_:129 or_:130 power:131 ref:132 term:133 unary:134




accuracy:358 expect:359 formulation:360 golden:361 init:362 limit:363 redundancy:364 scene_level:365 scene_statement:590 set_:367 solver:368 time:369 trace:370 when:371
__ariths_star_11:617






arith:480 atom:125 call:126 power:131 ref:132 term:133 trace_item:620 unary:134



row:621
rows:623


ref:626

action:608 ref:418

guard:627


arith:628 atom:125 call:126 power:131 ref:132 term:133 unary:134
and_:123 arith:124 atom:125 call:126 compare:127 expr:629 not_:129 or_:130 power:131 ref:132 term:133 unary:134


arith:632 atom:125 call:126 power:131 ref:132 term:133 unary:134


__rows_star_3:634
_signed:637 negative_number:638








arith:641 atom:125 call:126 power:131 ref:132 term:133 unary:134



row:644

__row_plus_4:646




row:648




_signed:652 negative_number:638



_signed:653 negative_number:638


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
___body{item}_star_18 2 [] 1
_body{item} 3 [] 1 2*
_body{item} 3 [] 1
_body{bundle_member} 0 []
component 3 component 1 2
_body{statement} 0 []
_body{role} 0 []
dotted 2 dotted 0 1*
model 3 model 1 2
unit_base 3 unit_base 1
___body{item}_star_18 3 [] 0* 2
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
___body{bundle_member}_star_20 2 [] 1
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
___body{statement}_star_22 2 [] 1
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
__or__star_13 2 [] 1
compare 3 compare 0 1 2
power 3 power 0 2
__and__star_14 2 [] 1
ref 3 member 0 2
__arith_star_15 2 [] 0 1
__arith_star_15 2 [] 0 1
__term_star_16 2 [] 0 1
__term_star_16 2 [] 0 1
atom 3 group 1
_args 1 [] 0
arg 1 arg 0
call 3 call 0
atom 3 array 1
_body{role} 3 [] 0 1*
___body{role}_star_19 2 [] 1
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
___body{bundle_member}_star_20 3 [] 0* 2
unit 2 unit 0 1*
unit_factor 2 unit_variable 1
__words_star_1 3 [] 0* 2
_body{bundle_member} 4 [] 1 2*
instance 4 instance 0 2 3 -
connections 1 connections 0
instance 4 instance 0 2 - 3
connection 1 single 0
___body{statement}_star_22 3 [] 0* 2
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
__or__star_13 3 [] 0* 2
__and__star_14 3 [] 0* 2
ref 4 item_of 0 2
__arith_star_15 3 [] 0* 1 2
__arith_star_15 3 [] 0* 1 2
__term_star_16 3 [] 0* 1 2
__term_star_16 3 [] 0* 1 2
call 4 call 0 2*
_args 2 [] 0 1*
atom 4 array 1 2*
__atom_star_17 2 [] 1
___body{role}_star_19 3 [] 0* 2
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
__unit_star_12 2 [] 0 1
__unit_star_12 2 [] 0 1
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
__atom_star_17 3 [] 0* 2
function 8 function 1 - 5 7
_body{scene_statement} 3 [] 0 1*
___body{scene_statement}_star_21 2 [] 1
_body{scene_statement} 3 [] 1 2*
_body{scene_statement} 3 [] 1
limit 3 limit 1 2
solver 3 solver 1 2
trace_items 2 trace_items 0 1*
__unit_star_12 3 [] 0* 1 2
__unit_star_12 3 [] 0* 1 2
unit_factor 4 unit_variable 1 3*
negative_number 2 negative_number 1
__connections_star_6 2 [] 1
connection 3 across 0 2
args 3 args 1*
connection 3 bind 0 2
__indices_star_9 3 [] 0* 2
coord 6 coord 0 1 3 4 5
discrete 6 discrete 1 3 5
_body{action} 3 [] 0 1*
___body{action}_star_23 2 [] 1
action 3 action 0 2
_body{action} 3 [] 1 2*
_body{action} 3 [] 1
expect 6 expect - 1 2 3 5
input 6 input 1 3 5
level 6 level 1 3 4 5
param 6 param 1 3 5
guards 0 guards
state 6 state 1 3 5
atom 6 method 0 2 4*
___args_star_7 3 [] 0* 2
expr 6 conditional 1 3 5
function 9 function 1 3 6 8
parameter 6 parameter 0 2 5
___body{scene_statement}_star_21 3 [] 0* 2
_body{scene_statement} 4 [] 1 2*
ariths 1 ariths 0
accuracy 4 accuracy 1 3
scene_level 4 scene_level 1 3
set_ 4 set_ 1 3
time 4 time 1 3
trace_item 3 trace_item 0 - 2
trace_item 3 trace_item 0 2 -
__trace_items_star_10 2 [] 1
trace 4 trace 1 3
table 9 table 1 3 6 7 - 8
__connections_star_6 3 [] 0* 2
___body{action}_star_23 3 [] 0* 2
_body{action} 4 [] 1 2*
expect 7 expect 1 2 3 4 6
guards 1 guards 0*
__guards_star_5 1 [] 0
constraint 7 constraint 0 1 3 4 5 6
ariths 2 ariths 0 1*
__trace_items_star_10 3 [] 0* 2
table 10 table 1 3 6 7 8 9
table 10 table_file 1 3 6 7 - 9
connection 5 bind_across 0 2 4
__guards_star_5 2 [] 0* 1
guard 2 guard_restitution 1
guard 2 guard_while 1
call 8 reduction 0 2 4 6
__ariths_star_11 2 [] 1
trace_item 5 trace_item 0 2 4
rows 3 rows 1
_signed 1 [] 0
_signed 1 [] 0
table 11 table_file 1 3 6 7 8 10
__ariths_star_11 3 [] 0* 2
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
